// How unit quaternions deviate from one another.
#pragma once

namespace pilotfish {

// error (3, BLOCK) = 2 log(mean* q) of q (4, BLOCK) or -q, whichever is nearer; mean is w, x, y, z.
void rotation_vectors(const double* q, const double* mean, double* error);

}  // namespace pilotfish
