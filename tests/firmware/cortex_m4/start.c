/* From reset to main on a Cortex-M4F: vectors, floating-point unit, data and bss. */
#include <stdint.h>

#include "semihosting.h"

extern uint32_t data_source[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];
int main(void);

void reset(void);

static void fault(void) { semihosting_exit(99); }

__attribute__((section(".vectors"), used)) static const uintptr_t VECTORS[16] = {
    (uintptr_t)stack_top, (uintptr_t)reset, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault,
    (uintptr_t)fault,     (uintptr_t)fault,
};

void reset(void) {
  *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* CPACR: full access to the floating-point unit */
  __asm__ volatile("dsb\n isb");
  const uint32_t *source = data_source;
  for (uint32_t *to = data_begin; to < data_end; to++) {
    *to = *source++;
  }
  for (uint32_t *to = bss_begin; to < bss_end; to++) {
    *to = 0;
  }
  semihosting_exit(main());
}
