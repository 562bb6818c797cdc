/* Random writes of parameters, packets for the memory and samples of the control loop, for the whole app on the shim.
 *
 *   fuzz_shell shell CASES SEED BUNDLE
 *
 * A case is what a ground may send in a ms, and that ms. Ends with 1 where a promise of the app is broken. */
#include "draw.h"
#include "memory.h"
#include "shell.h"
#include "shim.h"

enum {
  LONGEST_CALLBACK_MS = 21,
  MOST_READ = 24,    /* bytes of the firmware's packets */
  MOST_WRITTEN = 25,
  MOTORS_STOP_MS = 250,
};

static uint32_t number, waited_ms, vouched_at, override_at;
static bool has_vouched;
static setpoint_t setpoint;
static state_t state;
static sensorData_t sensors;

static bool set(const char *name, const void *bytes, int size) {
  const bool was_written = shim_write(name, bytes, size);
  if (was_written && strcmp(name, "perch.motTok") == 0) {
    has_vouched = true;
    vouched_at = shim_the_world()->tick_ms;
  }
  return was_written;
}

static bool set_byte(const char *name, uint8_t value) { return set(name, &value, 1); }
static bool set_float(const char *name, float value) { return set(name, &value, 4); }

/* Anything into any parameter, but for those of the firmware, of its own size or another. */
static void write_anything(void) {
  uint8_t bytes[8], type;
  int count = 0;
  while (shim_parameter_name(count, &type) != NULL) {
    count++;
  }
  const char *name = shim_parameter_name((int)below((uint32_t)count), &type);
  for (int i = 0; i < 8; i++) {
    bytes[i] = (uint8_t)(below(2) ? below(3) : random_word());
  }
  const float real = random_float(4.0f);
  if (type == 0x06) {
    memcpy(bytes, &real, sizeof real);
  }
  if (strncmp(name, "perch.", 6) == 0) {
    const int size = below(8) == 0 ? (int)below(9) : 1 << (type & 3);
    const bool was_written = set(name, bytes, size);
    require(!was_written || size == 1 << (type & 3), "a write of another size was taken", number);
    require(!was_written || !(type & 0x40), "a parameter to be read only was written", number);
  }
}

/* Mostly an approach that is sound. */
static void arm_approach(void) {
  static const char *const names[] = {"perch.vx", "perch.vz", "perch.xImp", "perch.yImp",
                                      "perch.zCeil", "perch.ax", "perch.az", "perch.tau0"};
  static const float sound[] = {1.0f, 1.5f, 0.0f, 0.0f, 2.1f, 2.0f, 3.1f, 0.4f};
  for (int i = 0; i < 8; i++) {
    set_float(names[i], below(40) == 0 ? random_float(4.0f) : sound[i]);
  }
  set_byte("perch.trjArm", below(6) != 0);
}

static void upload(void) {
  static perch_bank bank;
  const uint32_t length = below(2) ? spoil(&bank) : (memcpy(&bank, &good, sizeof good), good_length);
  const uint32_t crc = perch_crc32(0, bank.bytes, length <= sizeof bank ? length : (uint32_t)sizeof bank);
  for (uint32_t at = 0; at < length && at < sizeof bank; at += MOST_WRITTEN) {
    uint8_t packet[MOST_WRITTEN];
    const uint32_t left = (uint32_t)sizeof bank - at, bytes = left < MOST_WRITTEN ? left : MOST_WRITTEN;
    memcpy(packet, bank.bytes + at, bytes);
    shim_memory_write(at, (uint8_t)bytes, packet);
  }
  const uint16_t said = (uint16_t)length;
  set("perch.polLen", &said, 2);
  set("perch.polCrc", &crc, 4);
  set_byte("perch.polCommit", 1);
}

/* Whatever address and length a packet says; the firmware's buffers have their size whatever it is. */
static void send_to_memory(void) {
  static const uint32_t near[] = {0, PERCH_MAX_BUNDLE, PERCH_RECORD_ADDRESS, UINT32_MAX};
  const uint32_t place = below(5) == 4 ? shim_memory_size() : near[below(4)];
  const uint32_t address = below(8) == 0 ? random_word() : place + below(64) - 32;
  const uint8_t length = (uint8_t)(below(4) == 0 ? random_word() : below(30));
  if (below(2)) {
    uint8_t *buffer = malloc(MOST_READ);
    require(!shim_memory_read(address, length, buffer) || length <= MOST_READ, "more was read than fits", number);
    free(buffer);
    return;
  }
  uint8_t *buffer = calloc(1, MOST_WRITTEN);
  const bool was_written = shim_memory_write(address, length, buffer);
  const bool fits = length <= MOST_WRITTEN && address + length <= PERCH_MAX_BUNDLE;
  require(!was_written || fits, "written beyond the staged bundle", number);
  require(!(was_written && shim_the_world()->flying), "written in flight", number);
  free(buffer);
}

/* Mostly what is on already, or one that begins. */
static uint8_t random_rehearsal(void) {
  const bool goes_on = perch.rehearses != PERCH_NO_REHEARSAL && below(20) != 0;
  return (uint8_t)(goes_on ? perch.rehearses : below(4));
}

static void send_something(void) {
  switch (below(10)) {
    case 0: write_anything(); break;
    case 1: arm_approach(); break;
    case 2: upload(); break;
    case 3: send_to_memory(); break;
    case 4: set_byte("perch.go", below(4) != 0); break;
    case 5: set_byte("perch.abort", below(30) == 0); break;
    case 6: set_byte("perch.polArm", below(4) != 0); break;
    case 7: set_byte("perch.rehearse", random_rehearsal()); break;
    case 8: set_byte("perch.motTok", (uint8_t)random_word()); break;
    default: set_byte("perch.ownLaw", below(3) != 0); break;
  }
}

static vector_t random_vector(float scale) {
  return (vector_t){random_float(scale), random_float(scale), random_float(scale)};
}

static void random_setpoint(void) {
  memset(&setpoint, 0, sizeof setpoint);
  setpoint.timestamp = shim_the_world()->tick_ms - below(30);
  if (below(10) == 0) {
    return;
  }
  stab_mode_t *const modes[] = {&setpoint.mode.x, &setpoint.mode.y, &setpoint.mode.z, &setpoint.mode.roll,
                                &setpoint.mode.pitch, &setpoint.mode.yaw, &setpoint.mode.quat};
  for (int i = 0; i < 7; i++) {
    *modes[i] = (stab_mode_t)below(3);
  }
  setpoint.attitude = (attitude_t){random_float(60.0f), random_float(60.0f), random_float(180.0f)};
  setpoint.attitudeRate = (attitude_t){random_float(200.0f), random_float(200.0f), random_float(200.0f)};
  setpoint.attitudeQuaternion = (quaternion_t){random_float(1.0f), random_float(1.0f), random_float(1.0f), 1.0f};
  setpoint.thrust = random_float(65535.0f);
  setpoint.position = random_vector(2.0f);
  setpoint.velocity = random_vector(2.0f);
  setpoint.acceleration = random_vector(5.0f);
  setpoint.velocity_body = below(2);
}

/* The rest of the firmware does anything at all. */
static void wild_sample(shim_world *world) {
  world->flying = below(100) != 0;
  world->armed = below(4) != 0;
  world->voltage = below(100) == 0 ? random_float(5.0f) : 3.9f;
  world->estimator = below(200) == 0 ? (uint8_t)below(4) : 2;
  world->idle_thrust = below(200) == 0 ? random_word() : 0;
  world->motors[below(4)] = (uint16_t)(below(100) == 0 ? random_word() : 0);
  world->pose_tick = (uint16_t)(below(100) == 0 ? random_word() : world->tick_ms);
  if (below(20) == 0) {
    state.position = random_vector(2.0f);
    state.velocity = random_vector(3.0f);
    state.attitudeQuaternion = (quaternion_t){random_float(0.3f), random_float(0.3f), random_float(1.0f), 1.0f};
  }
  sensors.gyro = below(50) == 0 ? random_vector(2000.0f) : random_vector(30.0f);
  if (below(50) == 0) {
    random_setpoint();
  }
}

/* What lets the landing machine go on: a drone at its start, on its way, in its flip, braking, or cut. */
static void calm_sample(shim_world *world) {
  const perch_plan *plan = &perch.plan;
  const vector_t still = {0.0f, 0.0f, 0.0f};
  const bool is_on_the_desk = perch.rehearses != PERCH_NO_REHEARSAL;
  world->flying = !is_on_the_desk;
  world->armed = !is_on_the_desk || below(50) == 0; /* somebody tries */
  world->voltage = 3.9f;
  world->estimator = 2;
  world->idle_thrust = 0;
  memset(world->motors, 0, sizeof world->motors);
  world->pose_tick = (uint16_t)(world->tick_ms - below(3));
  memset(&setpoint, 0, sizeof setpoint);
  setpoint.timestamp = world->tick_ms;
  setpoint.mode.x = setpoint.mode.y = setpoint.mode.z = is_on_the_desk ? modeDisable : modeAbs;
  sensors.gyro = still;
  switch ((perch_state)perch.landing.state) {
    case PERCH_IDLE:
    case PERCH_TRAJECTORY_ARMED:
      state.attitudeQuaternion = (quaternion_t){0.0f, 0.0f, 0.0f, 1.0f};
      state.position = isfinite(plan->x0) ? (vector_t){plan->x0, plan->y0, plan->z0} : (vector_t){0.0f, 0.0f, 1.0f};
      state.velocity = still;
      break;
    case PERCH_APPROACH:
      state.velocity = (vector_t){plan->vx, 0.0f, plan->vz};
      state.position.z += 0.001f * plan->vz;
      break;
    case PERCH_FLIP:
      sensors.gyro.y = -800.0f;
      break;
    case PERCH_BRAKE:
      state.velocity = (vector_t){0.1f, 0.0f, -0.6f};
      break;
    case PERCH_HOLD:
      state.velocity = still;
      break;
    case PERCH_CUT:
    case PERCH_FAULT:
      world->flying = world->armed = false;
      set_byte("perch.polArm", 0);
      set_byte("perch.trjArm", 0);
      break;
  }
}

static void random_sample(shim_world *world) {
  static enum { CALM, WILD, LOST, DESK } mood;
  if (below(400) == 0) {
    mood = below(6) == 0 ? WILD : below(5) == 0 ? LOST : below(6) == 0 ? DESK : CALM;
  }
  if (below(300) == 0) {
    world->motor_override = (uint8_t)(below(8) ? 0 : random_word());
    override_at = world->tick_ms;
  }
  world->app_late_ms = below(50) == 0 ? below(31) : world->app_late_ms;
  if (mood == WILD) {
    wild_sample(world);
  } else {
    calm_sample(world);
  }
  if (mood == DESK) {
    world->flying = false;
    world->armed = below(50) == 0;
    setpoint.mode.x = setpoint.mode.y = setpoint.mode.z = modeDisable;
  }
  if (mood == LOST && perch.landing.state != PERCH_APPROACH) {
    state.position.x = NAN;
  }
}

/* One ms of the control loop, and what came out of it. */
static void step(const shim_world *world) {
  static uint32_t steps;
  control_t control = {{NAN, NAN, NAN, NAN}, controlModeForceTorque};
  const perch_quaternion *own = &perch.landing.attitude;
  shim_control(&control, &setpoint, &sensors, &state, ++steps);
  const bool is_ours = control.controlMode == controlModeForce;
  require(is_ours || control.controlMode == controlModeLegacy, "no controller answers", number);
  for (int i = 0; i < 4 && is_ours; i++) {
    const float force = control.normalizedForces[i];
    require(force >= 0.0f && force <= 1.0f, "a force beyond 0 to 1", number);
    require(!perch.outputs.rehearses || force == 0.0f, "motors run on the desk", number);
    require(world->flying || perch_is_configured() || force == 0.0f, "motors run in a wrong configuration", number);
  }
  require(!perch.landing.attitude_known || isfinite(own->x + own->y + own->z + own->w), "an attitude of NaN", number);
  require(!perch.outputs.rehearses || is_ours, "another controller on the desk", number);
  require(!perch.outputs.rehearses || !world->armed, "armed on the desk", number);
}

static void one_ms(shim_world *world) {
  static uint32_t others_ms; /* that somebody else's controller has the motors */
  const uint32_t policy = perch_live_crc(&perch);
  world->tick_ms++;
  others_ms = others_ms > 0 ? others_ms - 1 : below(3000) == 0 ? below(60) : 0;
  if (others_ms == 0) {
    step(world);
  }
  shim_go_on_with_parameters();
  waited_ms = shim_parameter_task_waits() ? waited_ms + 1 : 0; /* the next write finds none that waits */
  require(waited_ms < LONGEST_CALLBACK_MS, "a callback waits too long", number);
  shim_go_on_with_app();
  require(!world->flying || perch_live_crc(&perch) == policy, "a policy was replaced in flight", number);
  const bool was_vouched_for = has_vouched && (int32_t)(vouched_at - override_at) >= 0;
  const bool is_late = world->tick_ms - vouched_at > MOTORS_STOP_MS;
  require(!was_vouched_for || !is_late || world->motor_override == 0, "motors of a silent host run on", number);
}

int main(int argc, char **argv) {
  if (argc != 5 || !begin_drawing(argv[4], argv[3])) {
    fprintf(stderr, "usage: fuzz_shell shell CASES SEED BUNDLE\n");
    return 2;
  }
  shim_world *world = shim_the_world();
  world->tick_ms = below(2) ? 0 : UINT32_MAX - below(5000); /* wraps soon */
  state.attitudeQuaternion.w = 1.0f;
  shim_boot();
  const uint32_t cases = (uint32_t)strtoul(argv[2], NULL, 10);
  uint32_t states[PERCH_FAULT + 1] = {0};
  for (; number < cases; number++) {
    const uint32_t policy = perch_live_crc(&perch);
    random_sample(world);
    if (below(6) == 0) {
      send_something();
    }
    require(!world->flying || perch_live_crc(&perch) == policy, "a policy was replaced in flight", number);
    one_ms(world);
    states[perch.landing.state]++;
  }
  print_states(states);
  return 0;
}
