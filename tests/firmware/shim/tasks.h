#ifndef PERCH_SHIM_TASKS_H
#define PERCH_SHIM_TASKS_H

#include <stdbool.h>
#include <stdint.h>
#include <ucontext.h>

typedef struct {
  ucontext_t context;
  void *stack;
  void (*function)(void *);
  void *argument;
  bool is_alive;
  uint32_t wakes_at;  /* ms: when its delay is over */
  int interrupted_in; /* places until it is interrupted; 0: it is not */
} shim_task;

/* Run a function on the task's stack until it ends, delays itself or is interrupted. */
void shim_start(shim_task *task, void (*function)(void *), void *argument);

/* Let it go on. */
void shim_go_on(shim_task *task);

#endif
