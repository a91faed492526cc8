// Row updates of the semi-tied transform.
#pragma once

namespace pilotfish {

// Improves transform (D, D) in place. Masses are positive.
// Returns -1, or the row that has no update, or D when the transform itself has no inverse.
int semi_tied_sweeps(int K, int D, const double* covariances, const double* counts, double* transform,
                     int sweeps);

}  // namespace pilotfish
