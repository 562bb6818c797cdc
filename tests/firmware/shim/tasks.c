/* Tasks on stacks of their own, each of which runs until it delays itself.
 *
 * Compiled with -finstrument-functions -Dmemcpy=shim_copy a task can be interrupted, too: wherever a function begins or
 * ends, and before, after and in the middle of what is copied. */
#include "tasks.h"

#include <stdlib.h>
#include <ucontext.h>

#include "static_mem.h"
#include "system.h"
#include "task.h"

enum { STACK_BYTES = 256 * 1024 };

static ucontext_t outside;
static shim_task *running;

static void begin(void) {
  shim_task *task = running;
  task->function(task->argument);
  task->is_alive = false;
  swapcontext(&task->context, &outside);
}

void shim_start(shim_task *task, void (*function)(void *), void *argument) {
  if (task->stack == NULL) {
    task->stack = malloc(STACK_BYTES);
  }
  getcontext(&task->context);
  task->context.uc_stack.ss_sp = task->stack;
  task->context.uc_stack.ss_size = STACK_BYTES;
  task->context.uc_link = &outside;
  task->function = function;
  task->argument = argument;
  task->is_alive = true;
  makecontext(&task->context, begin, 0);
  shim_go_on(task);
}

void shim_go_on(shim_task *task) {
  if (task->is_alive && running == NULL) {
    running = task;
    swapcontext(&outside, &task->context);
    running = NULL;
  }
}

void vTaskDelay(uint32_t ticks) {
  shim_task *task = running;
  task->wakes_at = xTaskGetTickCount() + ticks;
  swapcontext(&task->context, &outside);
}

void systemWaitStart(void) {}

/* Hidden, or the C library's, which do nothing, would be called. */
#define NOT_ITSELF __attribute__((no_instrument_function, visibility("hidden")))

__attribute__((no_instrument_function)) static void interrupt_in_time(void) {
  shim_task *task = running;
  if (task != NULL && task->interrupted_in > 0 && --task->interrupted_in == 0) {
    swapcontext(&task->context, &outside);
  }
}

NOT_ITSELF void *shim_copy(void *to, const void *from, size_t bytes);

void *shim_copy(void *to, const void *from, size_t bytes) {
  uint8_t *target = to;
  const uint8_t *source = from;
  interrupt_in_time();
  for (size_t i = 0; i < bytes; i++) {
    if (i == bytes / 2) {
      interrupt_in_time();
    }
    target[i] = source[i];
  }
  interrupt_in_time();
  return to;
}

NOT_ITSELF void __cyg_profile_func_enter(void *function, void *caller);
NOT_ITSELF void __cyg_profile_func_exit(void *function, void *caller);

void __cyg_profile_func_enter(void *function, void *caller) {
  (void)function, (void)caller;
  interrupt_in_time();
}

void __cyg_profile_func_exit(void *function, void *caller) {
  (void)function, (void)caller;
  interrupt_in_time();
}
