/* Random bundles, memory accesses and sequences of requests and samples, for the core under sanitizers.
 *
 *   fuzz bundles|memory|sequences CASES SEED BUNDLE
 *
 * BUNDLE is a file with a good bundle. Ends with 1 where a promise of the core is broken, and says which. */
#include "draw.h"
#include "memory.h"
#include "vehicle_constants.h"

static perch_core core;

static void fuzz_bundle(uint32_t number) {
  static perch_bank bank;
  perch_policy policy;
  const uint32_t length = spoil(&bank);
  if (perch_parse_bundle(&bank, length, &policy) != PERCH_POLICY_ACTIVE) {
    return;
  }
  const perch_cues cues = {random_float(1.0f), random_float(30.0f), random_float(3.0f)};
  const float moment = perch_action_moment(&policy, &cues);
  require(moment >= -0.05f && moment <= 0.0f, "a moment beyond any policy's range", number);
  (void)perch_trigger_value(&policy, &cues);
}

static uint32_t random_address(void) {
  static const uint32_t NEAR[] = {0, PERCH_MAX_BUNDLE, PERCH_RECORD_ADDRESS, UINT32_MAX, UINT32_MAX / 2};
  const uint32_t near = below(6) == 5 ? perch_memory_size() : NEAR[below(5)];
  return below(8) == 0 ? random_word() : near + below(64) - 32;
}

static void fuzz_memory(uint32_t number) {
  uint8_t bytes[64], before = core.recorder.state;
  const uint32_t address = random_address();
  const uint32_t length = below(16) == 0 ? random_word() : below(sizeof bytes + 1);
  const bool fits = length <= sizeof bytes;
  memset(bytes, (int)below(256), sizeof bytes);
  if (fits || address > perch_memory_size()) {
    const bool read = perch_memory_read(&core, address, length, bytes);
    require(!read || fits, "more was read than there is", number);
    const bool flying = below(2);
    const bool written = perch_memory_write(&core, address, length, bytes, flying);
    require(!(written && flying), "written in flight", number);
    require(!written || address + length <= PERCH_MAX_BUNDLE, "written beyond the staged bundle", number);
    require(core.recorder.state == before, "the recorder was written", number);
  }
}

static perch_vector random_vector(float scale) {
  return (perch_vector){random_float(scale), random_float(scale), random_float(scale)};
}

static void random_setpoint(perch_setpoint *setpoint) {
  memset(setpoint, 0, sizeof *setpoint);
  if (below(10) == 0) {
    return;
  }
  for (int i = 0; i < 3; i++) {
    setpoint->mode[i] = (uint8_t)below(3);
  }
  setpoint->mode_roll = (uint8_t)below(3);
  setpoint->mode_pitch = (uint8_t)below(3);
  setpoint->mode_yaw = (uint8_t)below(3);
  setpoint->mode_quaternion = (uint8_t)below(3);
  setpoint->velocity_body = below(2);
  setpoint->position = random_vector(2.0f);
  setpoint->velocity = random_vector(2.0f);
  setpoint->acceleration = random_vector(5.0f);
  setpoint->roll = random_float(1.0f);
  setpoint->pitch = random_float(1.0f);
  setpoint->yaw = random_float(4.0f);
  setpoint->rates = random_vector(3.0f);
  setpoint->quaternion = (perch_quaternion){random_float(1.0f), random_float(1.0f), random_float(1.0f), 1.0f};
  setpoint->thrust = random_float(65535.0f);
}

static void random_commit(void) {
  static perch_bank bank;
  const uint32_t length = below(2) ? spoil(&bank) : (memcpy(&bank, &good, sizeof good), good_length);
  const bool flying = below(2);
  if (perch_memory_write(&core, 0, length, bank.bytes, flying)) {
    perch_commit(&core, length, perch_crc32(0, bank.bytes, length), flying);
  }
}

/* Mostly what is on already, or nothing. */
static uint8_t random_rehearsal(void) {
  const bool goes_on = core.rehearses != PERCH_NO_REHEARSAL ? below(20) != 0 : below(3) != 0;
  return (uint8_t)(goes_on ? core.rehearses : below(4));
}

/* Mostly an approach that is sound. */
static void random_request(void) {
  perch_approach approach = {1.0f, 1.5f, 0.0f, 0.0f, 2.1f, 2.0f, 3.1f, 0.4f};
  if (below(3) == 0) {
    approach.vx = random_float(4.0f);
    approach.vz = random_float(4.0f);
    approach.az = random_float(4.0f);
  }
  switch (below(7)) {
    case 0:
      perch_post(&core, below(4) != 0, &approach);
      break;
    case 1:
      perch_ask_go(&core, below(4) != 0);
      break;
    case 2:
      perch_ask_abort(&core, below(16) == 0);
      break;
    case 3:
      perch_arm_policy(&core, below(4) != 0);
      break;
    case 4:
      random_commit();
      break;
    case 5:
      perch_rehearse(&core, random_rehearsal(), below(20) != 0);
      break;
    default:
      perch_set_ceiling(&core, random_float(3.0f));
      break;
  }
}

/* Anything at all. */
static void wild_sample(perch_inputs *in) {
  in->pose_age = below(100) == 0 ? PERCH_NO_POSE : below(40);
  in->flying = below(200) != 0;
  in->levelling = below(300) == 0;
  in->thrust_seen = below(300) == 0;
  in->voltage = below(100) == 0 ? random_float(5.0f) : 3.9f;
  if (below(20) == 0) {
    in->estimate.position = random_vector(2.0f);
    in->estimate.velocity = random_vector(3.0f);
  }
  if (below(100) == 0) {
    in->estimate.quaternion = (perch_quaternion){random_float(0.3f), random_float(0.3f), random_float(1.0f), 1.0f};
  }
  in->estimate.gyro = below(50) == 0 ? random_vector(30.0f) : random_vector(0.5f);
  if (below(50) == 0) {
    random_setpoint(&in->setpoint);
  }
}

/* What lets the landing machine go on: a drone at its start, on its way, in its flip, braking, or cut. */
static void calm_sample(perch_inputs *in) {
  const perch_plan *plan = &core.plan;
  const bool planned = isfinite(plan->x0);
  perch_estimate *e = &in->estimate;
  const perch_vector still = {0.0f, 0.0f, 0.0f};
  in->pose_age = 5;
  in->flying = true;
  in->levelling = false;
  in->voltage = 3.9f;
  in->setpoint.mode[0] = in->setpoint.mode[1] = in->setpoint.mode[2] = PERCH_MODE_ABSOLUTE;
  e->gyro = still;
  switch ((perch_state)core.landing.state) {
    case PERCH_IDLE:
    case PERCH_TRAJECTORY_ARMED:
      e->quaternion = (perch_quaternion){0.0f, 0.0f, 0.0f, 1.0f};
      e->position = planned ? (perch_vector){plan->x0, plan->y0, plan->z0} : (perch_vector){0.0f, 0.0f, 1.0f};
      e->velocity = still;
      break;
    case PERCH_APPROACH:
      e->velocity = (perch_vector){plan->vx, 0.0f, plan->vz};
      e->position.z += 0.001f * plan->vz;
      break;
    case PERCH_FLIP:
      e->gyro.y = -14.0f;
      break;
    case PERCH_BRAKE:
      e->velocity = (perch_vector){0.1f, 0.0f, -0.6f};
      break;
    case PERCH_HOLD:
      e->velocity = still;
      break;
    case PERCH_CUT:
    case PERCH_FAULT:
      in->flying = false;
      perch_arm_policy(&core, false);
      perch_post(&core, false, &(perch_approach){0});
      break;
  }
}

static void random_sample(perch_inputs *in) {
  static enum { WILD, LOST, CALM } mood;
  if (below(400) == 0) {
    mood = below(8) == 0 ? WILD : below(5) == 0 ? LOST : CALM;
    in->tick += below(10) == 0 ? below(2000) : 0;
  }
  in->tick++;
  in->thrust_seen = false;
  if (mood == WILD) {
    wild_sample(in);
  } else {
    calm_sample(in);
  }
  if (mood == LOST && core.landing.state != PERCH_APPROACH) {
    in->estimate.position.x = NAN;
  }
  if (core.rehearses && below(1000) != 0) { /* nobody flies on the desk */
    in->flying = in->thrust_seen = false;
    memset(&in->setpoint, 0, sizeof in->setpoint);
  }
}

static void check_outputs(const perch_inputs *in, uint32_t number) {
  const perch_outputs *out = &core.outputs;
  const bool silent =
      perch_setpoint_is_null(&in->setpoint) || out->state == PERCH_CUT || out->state == PERCH_FAULT;
  require(out->state <= PERCH_FAULT && out->reason <= PERCH_REASON_POSE_LOST, "an unknown state", number);
  for (int i = 0; i < 4; i++) {
    require(out->duties[i] >= 0.0f && out->duties[i] <= 1.0f, "a duty beyond 0 to 1", number);
    require(!(silent && out->mode == PERCH_OFF) || out->duties[i] == 0.0f, "motors run that are cut", number);
    require(!perch_setpoint_is_null(&in->setpoint) || out->duties[i] == 0.0f, "motors run unasked", number);
    require(!out->rehearses || (out->duties[i] == 0.0f && out->thrusts[i] == 0.0f), "motors run on the desk", number);
  }
  const perch_quaternion *own = &core.landing.attitude;
  require(!core.landing.attitude_known || isfinite(own->x + own->y + own->z + own->w), "an attitude of NaN", number);
  require(core.rehearses <= PERCH_ON_MODEL, "an unknown rehearsal", number);
  require(!out->rehearses || !(in->flying || in->thrust_seen), "a rehearsal in flight", number);
  require(out->state != PERCH_FLIP || isfinite(core.landing.snapshot.a_rot), "a flip of NaN", number);
  require(core.recorder.state <= PERCH_RECORD_ENDS, "an unknown state of the recorder", number);
}

static void fuzz_sequence(uint32_t number) {
  static perch_inputs in;
  if (number == 0 || below(20000) == 0) {
    perch_boot(&core, &PERCH_VEHICLE);
    memset(&in, 0, sizeof in);
    in.estimate.quaternion.w = 1.0f;
    in.tick = below(2) ? 0 : UINT32_MAX - below(5000); /* wraps soon */
    random_setpoint(&in.setpoint);
  }
  if (below(10) == 0) {
    random_request();
  }
  random_sample(&in);
  perch_step(&core, &in);
  check_outputs(&in, number);
}

int main(int argc, char **argv) {
  if (argc != 5 || !begin_drawing(argv[4], argv[3])) {
    fprintf(stderr, "usage: fuzz bundles|memory|sequences CASES SEED BUNDLE\n");
    return 2;
  }
  perch_boot(&core, &PERCH_VEHICLE);
  const uint32_t cases = (uint32_t)strtoul(argv[2], NULL, 10);
  uint32_t states[PERCH_FAULT + 1] = {0};
  for (uint32_t i = 0; i < cases; i++) {
    if (argv[1][0] == 'b') {
      fuzz_bundle(i);
    } else if (argv[1][0] == 'm') {
      fuzz_memory(i);
    } else {
      fuzz_sequence(i);
      states[core.landing.state]++;
    }
  }
  print_states(states);
  return 0;
}
