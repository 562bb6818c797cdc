#include "rotation.h"

#include <float.h>

perch_quaternion perch_multiply(const perch_quaternion *a, const perch_quaternion *b) {
  return (perch_quaternion){
      a->w * b->x + a->x * b->w + a->y * b->z - a->z * b->y,
      a->w * b->y - a->x * b->z + a->y * b->w + a->z * b->x,
      a->w * b->z + a->x * b->y - a->y * b->x + a->z * b->w,
      a->w * b->w - a->x * b->x - a->y * b->y - a->z * b->z,
  };
}

perch_quaternion perch_normalise(const perch_quaternion *q) {
  const float length = sqrtf(q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w);
  if (!(length > 1e-12f && length <= FLT_MAX)) {
    return (perch_quaternion){NAN, NAN, NAN, NAN};
  }
  return (perch_quaternion){q->x / length, q->y / length, q->z / length, q->w / length};
}

perch_vector perch_body_x(const perch_quaternion *q) {
  return (perch_vector){
      1.0f - 2.0f * (q->y * q->y + q->z * q->z),
      2.0f * (q->x * q->y + q->z * q->w),
      2.0f * (q->x * q->z - q->y * q->w),
  };
}

perch_vector perch_body_y(const perch_quaternion *q) {
  return (perch_vector){
      2.0f * (q->x * q->y - q->z * q->w),
      1.0f - 2.0f * (q->x * q->x + q->z * q->z),
      2.0f * (q->y * q->z + q->x * q->w),
  };
}

perch_vector perch_body_z(const perch_quaternion *q) {
  return (perch_vector){
      2.0f * (q->x * q->z + q->y * q->w),
      2.0f * (q->y * q->z - q->x * q->w),
      1.0f - 2.0f * (q->x * q->x + q->y * q->y),
  };
}

perch_quaternion perch_from_rotation_vector(const perch_vector *r) {
  const float angle = perch_norm(r);
  /* sin(angle/2)/angle, by its series for small angles. */
  const float scale = angle < 1e-4f ? 0.5f - angle * angle / 48.0f : sinf(0.5f * angle) / angle;
  return (perch_quaternion){scale * r->x, scale * r->y, scale * r->z, cosf(0.5f * angle)};
}

perch_quaternion perch_integrate(const perch_quaternion *q, const perch_vector *omega, float dt) {
  const perch_vector turned = {omega->x * dt, omega->y * dt, omega->z * dt};
  const perch_quaternion turn = perch_from_rotation_vector(&turned);
  const perch_quaternion product = perch_multiply(q, &turn);
  return perch_normalise(&product);
}

perch_vector perch_euler_angles(const perch_quaternion *q) {
  return (perch_vector){
      atan2f(2.0f * (q->w * q->x + q->y * q->z), 1.0f - 2.0f * (q->x * q->x + q->y * q->y)),
      asinf(perch_clamp(2.0f * (q->w * q->y - q->z * q->x), -1.0f, 1.0f)),
      atan2f(2.0f * (q->w * q->z + q->x * q->y), 1.0f - 2.0f * (q->y * q->y + q->z * q->z)),
  };
}
