// Whiteners: inverses of the Cholesky factors of covariances.
#pragma once

namespace pilotfish {

// W (K, D, D), lower triangular, with W^T W = covariance^-1; lower triangles of covariances are read.
// Returns the first k whose covariance is not positive definite or not finite, else -1.
long precision_cholesky(long K, int D, const double* covariances, double* W);

}  // namespace pilotfish
