// Bumpless transfer and limits of the target. Defined by kernels/reference/target_motion.py.
#pragma once

#include "assistance.hpp"

namespace pilotfish {

// Returns the time of a blend with this offset (E).
double blend_duration(const Assistance& a, const double* offset);

// Writes the desired pose with what remains of the offset of result.
void blend(const Assistance& a, const AssistanceResult& result, const double* desired, double* blended);

// Writes pose, velocity and desired pose of result after a step towards a desired pose, within the limits.
void follow_desired(const Assistance& a, const double* desired, AssistanceResult& result);

}  // namespace pilotfish
