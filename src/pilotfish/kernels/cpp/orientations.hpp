// Deviations of unit quaternions: logarithmic map of S^3.
#pragma once

namespace pilotfish {

// Computes error (3, BLOCK) = 2 log(mean* q) for the nearer of q (4, BLOCK) and -q; mean is w, x, y, z.
void rotation_vectors(const double* q, const double* mean, double* error);

}  // namespace pilotfish
