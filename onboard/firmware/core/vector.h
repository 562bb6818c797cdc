/* Vectors and quaternions, and the two constants that everything needs. */
#ifndef PERCH_VECTOR_H
#define PERCH_VECTOR_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* m/s2. */
#define PERCH_GRAVITY 9.81f

typedef struct {
  float x, y, z;
} perch_vector;

/* Scalar last, unit length, body to world. */
typedef struct {
  float x, y, z, w;
} perch_quaternion;

/* Ternaries: fminf and fmaxf of newlib are slow, and treat NaN otherwise. A NaN in `a` gives `a`. */
static inline float perch_min(float a, float b) { return b < a ? b : a; }

static inline float perch_max(float a, float b) { return b > a ? b : a; }

static inline float perch_clamp(float value, float least, float most) {
  return perch_min(perch_max(value, least), most);
}

static inline bool perch_is_finite(const perch_vector *v) {
  return isfinite(v->x) && isfinite(v->y) && isfinite(v->z);
}

static inline float perch_dot(const perch_vector *a, const perch_vector *b) {
  return a->x * b->x + a->y * b->y + a->z * b->z;
}

static inline float perch_norm(const perch_vector *v) { return sqrtf(perch_dot(v, v)); }

static inline float perch_distance(const perch_vector *a, const perch_vector *b) {
  const perch_vector d = {a->x - b->x, a->y - b->y, a->z - b->z};
  return perch_norm(&d);
}

/* s of `ticks` ms: the float32 nearest to them, so that limits written in ms are met exactly. */
static inline float perch_seconds(uint32_t ticks) { return (float)ticks / 1000.0f; }

#endif
