/* The core as a library on the host: for the simulated drone, and for tests that compare many states at once. */
#ifndef PERCH_HOST_H
#define PERCH_HOST_H

#include "../core/memory.h"

/* Whatever a simulated drone asks of the core after a step. */
typedef struct {
  perch_outputs outputs;
  perch_snapshot snapshot;
  perch_flight_model model;
} perch_view;

/* Bytes of a core, inputs, view and recorder: what the other side must believe, too. */
void perch_host_sizes(uint32_t sizes[4]);

/* perch_step, and what came of it. */
void perch_host_step(perch_core *core, const perch_inputs *in, perch_view *view);

/* Each function of the core over `n` states, laid out one after the other. */
perch_policy_status perch_host_policy(const perch_bank *bank, uint32_t length, uint32_t n, const perch_cues *cues,
                                      float *values, float *moments);
void perch_host_cues(uint32_t n, const float (*z_vx_vz_ceiling)[4], perch_cues *cues);
void perch_host_control(const perch_vehicle *vehicle, uint32_t n, const perch_estimate *estimates,
                        const perch_vector *integrals, const perch_motion *targets, const float *yaws,
                        perch_wrench *wrenches);
void perch_host_level(const perch_vehicle *vehicle, uint32_t n, const perch_estimate *estimates,
                      const float *collectives, const float *yaws, perch_wrench *wrenches);
void perch_host_lead(const perch_vehicle *vehicle, uint32_t n, const perch_wrench *wrenches, perch_vector *lagged,
                     float dt, perch_wrench *leading);
void perch_host_mix(const perch_vehicle *vehicle, uint32_t n, const perch_wrench *wrenches, float (*thrusts)[4]);
void perch_host_flip(const perch_vehicle *vehicle, uint32_t n, const float *moments, float (*thrusts)[4]);
void perch_host_duty(const perch_vehicle *vehicle, uint32_t n, const float *thrusts, const float *voltages,
                     float *duties);
void perch_host_plan(uint32_t n, const perch_approach *approaches, perch_plan *plans);
void perch_host_approach(const perch_plan *plan, uint32_t n, const float *times, float half_width,
                         perch_motion *motions, float *jerks);
void perch_host_stopping(uint32_t n, const float (*speed_acceleration_lag)[3], float *distances);

void perch_host_model(const perch_vehicle *vehicle, uint32_t n, perch_flight_model *models, float dt);

/* One step of the landing machine alone. */
void perch_host_landing(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                        const perch_vehicle *vehicle, perch_landing_output *output);

#endif
