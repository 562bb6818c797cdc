/* Where the firmware begins with the app, and the app's own slow task. */
#include "app.h"

#include "FreeRTOS.h"
#include "desk.h"
#include "perch_vehicle_constants.h"
#include "shell.h"
#include "static_mem.h"
#include "supervisor.h"
#include "system.h"
#include "task.h"

/* That of logs, parameters and memories: below it nobody promises when it would stop a motor. */
enum { LOOK_PERIOD_MS = 20, STACK_WORDS = 350, TASK_PRIORITY = 1 };

perch_core perch;

STATIC_MEM_TASK_ALLOC(perchTask, STACK_WORDS);

static void perchTask(void *parameters) {
  (void)parameters;
  systemWaitStart();
  appMain();
}

/* In place of the firmware's own, because memories can only be shown this early. */
void appInit(void) {
  static bool is_initialised;
  if (is_initialised) {
    return;
  }
  is_initialised = true;
  perch_boot(&perch, &PERCH_VEHICLE);
  perch_ground.vehicle_crc = PERCH_VEHICLE_CRC;
  perch_register_memory();
  STATIC_MEM_TASK_CREATE(perchTask, perchTask, "PERCH", NULL, TASK_PRIORITY);
}

void appMain(void) {
  for (;;) {
    perch_check_configuration();
    /* On the desk the controller disarms at once; here for one who has chosen another controller. */
    const bool may_arm = perch_is_configured() && !perch_is_on_the_desk();
    if (!may_arm && supervisorIsArmed() && !supervisorIsFlying()) {
      supervisorRequestArming(false);
    }
    const uint32_t due_ms = perch_watch_bench_motors();
    vTaskDelay(M2T(due_ms < LOOK_PERIOD_MS ? due_ms : LOOK_PERIOD_MS));
  }
}
