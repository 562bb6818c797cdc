/* Whether the firmware is configured as the app needs it: without that nothing is armed. */
#include "param.h"
#include "shell.h"

enum { KALMAN = 2 };

static volatile bool is_configured;

/* Whether a parameter is there and has this value. */
static bool has_value(const char *group, const char *name, unsigned int wanted) {
  const paramVarId_t id = paramGetVarId(group, name);
  return PARAM_VARID_IS_VALID(id) && paramGetUint(id) == wanted;
}

void perch_check_configuration(void) {
  is_configured = has_value("powerDist", "idleThrust", 0) && /* or propellers turn in CUT */
                  has_value("stabilizer", "estimator", KALMAN) &&
                  has_value("motorPowerSet", "enable", 0); /* or nobody but the bench has the motors */
}

bool perch_is_configured(void) { return is_configured; }
