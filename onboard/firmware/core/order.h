/* Between tasks of one processor: what one has written when another interrupts it. */
#ifndef PERCH_ORDER_H
#define PERCH_ORDER_H

#include <stdatomic.h>

/* What is written before is in memory before what is written after, for an interrupting task. */
static inline void perch_in_this_order(void) { atomic_signal_fence(memory_order_seq_cst); }

#endif
