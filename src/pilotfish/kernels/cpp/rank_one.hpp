// Eigenvalues and eigenvectors of diag(poles) + z z^T in O(n^2).
//
// Secular equation. A value v that is not a pole is an eigenvalue if and only if
//
//     f(v) = 1 + sum over j of z_j^2 / (pole_j - v) = 0
//
// and its eigenvector has the entries z_j / (pole_j - v), normalised. Between two poles f increases from -inf
// to +inf, so that there is exactly one root above each pole and below the next larger one (interlacing); the
// largest root is below pole_0 + |z|^2.
//
// Deflation. If z_j is negligible, or two poles are almost equal (then a Givens rotation makes one z_j zero),
// the pole is an eigenvalue already and leaves the equation.
//
// Root finding. Roots are computed as distances from the nearer pole, so that no digit of a small distance is
// lost. A step interpolates the sums over poles below and above the root by one pole each (values and slopes
// agree), which gives a quadratic equation; a step that leaves the bracket is replaced by bisection.
//
// Orthogonality. Eigenvectors of close eigenvalues would lose orthogonality if computed from z. By Loewner's
// formula
//
//     z_j^2 = prod over k of (v_k - pole_j) / prod over k != j of (pole_k - pole_j)
//
// the computed eigenvalues belong exactly to a slightly different z; vectors computed from it are orthogonal.
//
// Invariants: values are in decreasing order and not negative; columns of R are orthonormal to rounding.
// Source: Bunch, Nielsen & Sorensen 1978; Gu & Eisenstat 1994, SIAM J. Matrix Anal. 15(4).
// Keep in step: kernels/reference/subspaces.py computes the same by numpy.linalg.eigh.
#pragma once

#include <vector>

#include "lanes.hpp"

namespace pilotfish {

// Solver of diag(poles) + z z^T = R diag(values) R^T, for poles in decreasing order, none of them negative.
class RankOne {
 public:
  // Computes values (n) in decreasing order and R (n, width), row-major, zero beyond n. Memory is kept
  // between calls.
  void solve(const double* poles, const double* z, int n, int width, double* values, double* R);

 private:
  struct Rotation {
    int i, j;
    double c, s;
  };

  void reserve(int n);
  int deflate(int n);
  void roots(int k, int m);
  void put_vector(int k, int column, int m, int width, double* R);
  void vectors(int n, int m, int width, double* values, double* R);

  Buffer d_, z_, pole_, weight_, gap_, shift_, true_z_, vector_;  // gap_[k m + j] = pole_j - value_k
  std::vector<int> kept_, order_;
  Buffer all_;
  std::vector<Rotation> rotations_;
};

}  // namespace pilotfish
