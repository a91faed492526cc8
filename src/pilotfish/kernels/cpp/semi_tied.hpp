// Row-wise ascent of the semi-tied transform. Defined by kernels/reference/semi_tied.py.
#pragma once

namespace pilotfish {

// Updates transform (D, D) in place; counts are positive. Returns -1, or the row that has no update, or D if
// the transform is singular.
int semi_tied_sweeps(int K, int D, const double* covariances, const double* counts, double* transform,
                     int sweeps);

}  // namespace pilotfish
