// Geometry of poses, and the motion of the target. Defined by kernels/reference/target_motion.py.
#pragma once

#include "assistance.hpp"

namespace pilotfish {

// Writes the tangent vector v (E) at base (D) whose geodesic reaches x (D).
void deviation(const Assistance& a, const double* base, const double* x, double* v);

// Writes the pose x (D) that the geodesic from base (D) along v (E) reaches; x may be base.
void displace(const Assistance& a, const double* base, const double* v, double* x);

// Writes the Hamilton product p q; the product may be p or q.
void multiply(const double* p, const double* q, double* product);

// Returns the time of a blend with this offset (E).
double blend_duration(const Assistance& a, const double* offset);

// Writes the desired pose with what remains of the offset of result.
void blend(const Assistance& a, const AssistanceResult& result, const double* desired, double* blended);

// Writes pose, velocity and desired pose of result after a step towards a desired pose, within the limits.
void follow_desired(const Assistance& a, const double* desired, AssistanceResult& result);

}  // namespace pilotfish
