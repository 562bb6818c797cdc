/* Motors of a bench test stop when their host falls silent.
 *
 * The firmware's motorPowerSet goes past supervisor and emergency stop, and what it has set turns until somebody
 * unsets it. A host that writes perch.motTok vouches for the motors from then on, and the app unsets them once it
 * has not done so for a quarter of a second. */
#include "bench_motors.h"

#include "FreeRTOS.h"
#include "param.h"
#include "shell.h"
#include "task.h"

enum { TOKEN_MS = 250 };

static volatile bool is_vouched_for;
static volatile uint32_t vouched_at;

void perch_vouch(void) {
  vouched_at = (uint32_t)xTaskGetTickCount();
  is_vouched_for = true;
}

void perch_watch_bench_motors(void) {
  const paramVarId_t enable = paramGetVarId("motorPowerSet", "enable");
  if (is_vouched_for && (uint32_t)xTaskGetTickCount() - vouched_at > TOKEN_MS) {
    is_vouched_for = false;
    if (PARAM_VARID_IS_VALID(enable) && paramGetUint(enable) != 0) {
      paramSetInt(enable, 0);
    }
  }
}
