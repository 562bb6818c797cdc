/* Motors of a bench test, and the host that vouches for them. */
#ifndef PERCH_BENCH_MOTORS_H
#define PERCH_BENCH_MOTORS_H

/* The host has said that it is there. */
void perch_vouch(void);

#endif
