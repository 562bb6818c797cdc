/* The core on an emulated Cortex-M4F: `inputs.bin` in, `outputs.bin` out, with the instructions that it took. */
#include <string.h>

#include "memory.h"
#include "rotation.h"
#include "semihosting.h"

enum { STATES = 2000, REPEATS = 50, COUNTS = 11 };

typedef struct {
  perch_vehicle vehicle;
  uint32_t bundle_length;
  perch_bank bundle;
  perch_cues cues[STATES];
  perch_estimate estimates[STATES];
  perch_vector integrals[STATES];
  perch_motion targets[STATES];
  float yaws[STATES];
} inputs;

typedef struct {
  uint32_t status;
  uint32_t core_bytes;
  uint32_t counts[COUNTS]; /* instructions of one call */
  float values[STATES], moments[STATES];
  perch_wrench wrenches[STATES];
  float thrusts[STATES][4];
  perch_quaternion turned[STATES];
  perch_flight_model flown[STATES];
} outputs;

static inputs in;
static outputs out;
static perch_core core;
static perch_inputs sample;
static perch_policy policy;
static perch_flight_model model;
static volatile float sink;

/* SysTick, with the clock of the processor: 25 MHz, of which QEMU's -icount shift=0 makes 40 instructions each. */
#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)
enum { INSTRUCTIONS_A_TICK = 40, FULL = 0xFFFFFF };

static void nothing(void) { sink = 1.0f; }

static void parse(void) { perch_parse_bundle(&in.bundle, in.bundle_length, &policy); }

static void trigger(void) { sink = perch_trigger_value(&policy, &in.cues[0]); }

static void action(void) { sink = perch_action_moment(&policy, &in.cues[0]); }

static void control(void) {
  const perch_wrench wrench =
      perch_geometric_control(&in.estimates[0], &in.integrals[0], &in.targets[0], in.yaws[0], &in.vehicle);
  sink = wrench.collective;
}

static void mix(void) { perch_mix(&out.wrenches[0], &in.vehicle, out.thrusts[0]); }

static void begin_record(void) { perch_record_begin(&core.recorder); }

static void fly(void) { perch_fly_model(&model, &in.vehicle, 0.001f); }

/* A step with landing machine and attitude loop, and one with policy and position loop besides. */
static void even_step(void) {
  sample.tick += 2;
  sample.tick += sample.tick % 10 == 0 ? 2 : 0;
  perch_step(&core, &sample);
}

static void whole_step(void) {
  sample.tick += 10 - sample.tick % 10;
  perch_step(&core, &sample);
}

static uint32_t ticks_of(void (*function)(void)) {
  SYST_RVR = FULL;
  SYST_CVR = 0;
  SYST_CSR = 5;
  const uint32_t begin = SYST_CVR;
  for (int i = 0; i < REPEATS; i++) {
    function();
  }
  return (begin - SYST_CVR) & FULL;
}

static uint32_t instructions_of(void (*function)(void)) {
  const uint32_t with = ticks_of(function), without = ticks_of(nothing);
  return (with - without) * INSTRUCTIONS_A_TICK / REPEATS;
}

/* The machine takes what was posted, and then the order to go, in a step of the policy. */
static void arm_and_go(void) {
  for (int i = 0; i < 20; i++) {
    sample.tick++;
    perch_step(&core, &sample);
  }
  perch_ask_go(&core, true);
  sample.tick += 2 - sample.tick % 2;
  perch_step(&core, &sample);
}

/* A core in an approach that climbs, with a policy that is not armed: the way to the ceiling is looked at. */
static void begin_approach(void) {
  const perch_approach approach = {0.5f, 0.5f, 0.0f, 0.0f, 3.0f, 1.0f, 3.1f, 1.0f};
  perch_boot(&core, &in.vehicle);
  memcpy(core.staged.bytes, in.bundle.bytes, in.bundle_length);
  perch_commit(&core, in.bundle_length, policy.crc, false);
  perch_post(&core, true, &approach);
  const perch_plan plan = perch_plan_approach(&approach);
  const perch_motion start = {.position = {plan.x0, plan.y0, plan.z0}};
  sample.estimate.position = start.position;
  sample.estimate.quaternion.w = 1.0f;
  sample.setpoint = perch_setpoint_of(&start);
  sample.voltage = 3.9f;
  sample.flying = true;
  arm_and_go();
  sample.estimate.velocity.z = 0.4f;
}

/* The same on the desk: no pose comes, and the model flies. */
static void begin_rehearsal(void) {
  const perch_approach approach = {0.5f, 0.5f, 0.0f, 0.0f, 3.0f, 1.0f, 3.1f, 1.0f};
  memset(&sample.estimate, 0, sizeof sample.estimate);
  memset(&sample.setpoint, 0, sizeof sample.setpoint);
  sample.flying = false;
  perch_boot(&core, &in.vehicle);
  perch_rehearse(&core, PERCH_ON_MODEL, true);
  perch_post(&core, true, &approach);
  arm_and_go();
}

static void count(void) {
  out.counts[0] = instructions_of(parse);
  out.counts[1] = instructions_of(trigger);
  out.counts[2] = instructions_of(action);
  out.counts[3] = instructions_of(control);
  out.counts[4] = instructions_of(mix);
  begin_approach();
  out.counts[5] = instructions_of(even_step);
  out.counts[6] = instructions_of(whole_step);
  out.counts[7] = core.landing.state == PERCH_APPROACH;
  const perch_vector origin = {0.0f, 0.0f, 0.0f};
  perch_start_model(&model, &origin, &in.vehicle);
  model.estimate.gyro.y = -20.0f;
  out.counts[8] = instructions_of(fly);
  begin_rehearsal();
  out.counts[9] = instructions_of(even_step);
  out.counts[10] = instructions_of(begin_record);
  out.counts[7] &= core.landing.state == PERCH_APPROACH;
}

static void compute(void) {
  for (int i = 0; i < STATES; i++) {
    out.values[i] = perch_trigger_value(&policy, &in.cues[i]);
    out.moments[i] = perch_action_moment(&policy, &in.cues[i]);
    out.wrenches[i] =
        perch_geometric_control(&in.estimates[i], &in.integrals[i], &in.targets[i], in.yaws[i], &in.vehicle);
    perch_mix(&out.wrenches[i], &in.vehicle, out.thrusts[i]);
    out.turned[i] = perch_integrate(&in.estimates[i].quaternion, &in.estimates[i].gyro, 0.002f);
    perch_start_model(&out.flown[i], &in.estimates[i].position, &in.vehicle);
    out.flown[i].estimate = in.estimates[i];
    memcpy(out.flown[i].asked, out.thrusts[i], sizeof out.flown[i].asked);
    perch_fly_model(&out.flown[i], &in.vehicle, 0.001f);
  }
}

int main(void) {
  int32_t file = semihosting_open("inputs.bin", 10, 1);
  if (file < 0 || semihosting_read(file, &in, sizeof in) != 0) {
    return 1;
  }
  out.core_bytes = sizeof core;
  out.status = (uint32_t)perch_parse_bundle(&in.bundle, in.bundle_length, &policy);
  if (out.status == PERCH_POLICY_ACTIVE) {
    compute();
    count();
  }
  file = semihosting_open("outputs.bin", 11, 5);
  return file < 0 || semihosting_write(file, &out, sizeof out) != 0 ? 2 : 0;
}
