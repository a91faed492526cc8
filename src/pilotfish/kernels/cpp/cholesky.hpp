// Inverses of the Cholesky factors of covariances. Defined by kernels/reference/cholesky.py.
#pragma once

namespace pilotfish {

// Computes W (K, D, D), lower triangular, with W^T W = covariance^-1; only lower triangles are read. Returns
// the first k whose covariance is not positive definite or not finite, else -1.
long precision_cholesky(long K, int D, const double* covariances, double* W);

}  // namespace pilotfish
