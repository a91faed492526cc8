// Product of Gaussians on R^n x S^3 x ... Defined by kernels/reference/riemannian.py.
#pragma once

#include "manifold.hpp"

namespace pilotfish {

// Gaussians of K states in P frames: means (P, K, D), covariances and precision_cholesky (P, K, E, E).
struct FrameGaussians {
  int P, K;
  const double *means, *covariances, *precision_cholesky;
};

// Writes means (K, D) and covariances (K, E, E) of the products over frames.
void riemannian_product(const Manifold& manifold, const FrameGaussians& given, double* means,
                        double* covariances);

}  // namespace pilotfish
