#include "recorder.h"

#include <stddef.h>
#include <string.h>

enum { PERIOD_MS = 10 };

void perch_record_begin(perch_recorder *recorder) {
  /* The periods are written whole as they come: to clear them here would take more than the rest of the step. */
  memset(recorder, 0, offsetof(perch_recorder, period));
  recorder->period_bytes = sizeof recorder->period[0];
  recorder->periods = PERCH_RECORD_PERIODS;
  recorder->state = PERCH_RECORD_RUNS;
}

void perch_record_end(perch_recorder *recorder, uint32_t tick) {
  if (recorder->state == PERCH_RECORD_RUNS) {
    recorder->state = PERCH_RECORD_ENDS;
    recorder->stop_tick = tick + PERCH_RECORD_AFTER_MS;
  }
}

bool perch_is_recorded(const perch_recorder *recorder, uint32_t tick) {
  const uint32_t phase = tick % PERIOD_MS;
  return recorder->state != PERCH_RECORD_OFF &&
         (phase == 0 || (phase == PERCH_RECORD_SECOND_SAMPLE_MS && recorder->begun > 0));
}

void perch_record(perch_recorder *recorder, uint32_t tick, const perch_policy_sample *policy,
                  const perch_law_sample *law) {
  if (tick % PERIOD_MS != 0) {
    recorder->period[(recorder->begun - 1) % PERCH_RECORD_PERIODS].law[1] = *law;
    return;
  }
  if (recorder->state == PERCH_RECORD_ENDS && (int32_t)(tick - recorder->stop_tick) >= 0) {
    recorder->state = PERCH_RECORD_OFF; /* between two periods, so that each is complete */
    return;
  }
  perch_period *period = &recorder->period[recorder->begun % PERCH_RECORD_PERIODS];
  period->policy = *policy;
  period->law[0] = *law;
  recorder->last_tick = tick;
  recorder->begun++;
}
