/* Motors of a bench test stop when their host falls silent.
 *
 * The firmware's motorPowerSet goes past supervisor and emergency stop, and what it has set turns until somebody
 * unsets it. A host that writes perch.motTok vouches for the motors from then on, and the app unsets them within a
 * quarter of a second of its last word: 30 ms of it are for tasks that have to wait, this one and that of the
 * parameters. The motors follow in the next ms. */
#include "bench_motors.h"

#include "FreeRTOS.h"
#include "param.h"
#include "shell.h"
#include "task.h"

enum { TOKEN_MS = 220 };

static volatile bool is_vouched_for;
static volatile uint32_t vouched_at;

void perch_vouch(void) {
  vouched_at = (uint32_t)xTaskGetTickCount();
  is_vouched_for = true;
}

static void stop_bench_motors(void) {
  const paramVarId_t enable = paramGetVarId("motorPowerSet", "enable");
  if (PARAM_VARID_IS_VALID(enable) && paramGetUint(enable) != 0) {
    paramSetInt(enable, 0);
  }
}

uint32_t perch_watch_bench_motors(void) {
  if (!is_vouched_for) {
    return TOKEN_MS;
  }
  /* First the word, then the time: one that comes in between is not in the future, which would be silence. */
  const uint32_t word_at = vouched_at;
  const uint32_t silent_ms = (uint32_t)xTaskGetTickCount() - word_at;
  if (silent_ms < TOKEN_MS) {
    return TOKEN_MS - silent_ms;
  }
  is_vouched_for = false;
  stop_bench_motors();
  return TOKEN_MS;
}
