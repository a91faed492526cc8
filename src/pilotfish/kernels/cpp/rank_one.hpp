// Eigenpairs of a diagonal matrix to which one outer product is added, in O(n^2) for values, O(n^3) never.
#pragma once

#include <vector>

#include "lanes.hpp"

namespace pilotfish {

// diag(poles) + z z^T = R diag(values) R^T for poles in falling order, none of them negative.
//
// What z hardly touches, and one of two poles that hardly differ, are eigenpairs already (deflation). Every
// other value is the one root of 1 + sum z_j^2 / (pole_j - value) between two poles. Vectors are those of the
// z to which the computed values belong exactly, so that they are orthogonal however close values lie.
// Source: Bunch, Nielsen & Sorensen 1978; Gu & Eisenstat 1994, SIAM J. Matrix Anal. 15(4).
class RankOne {
 public:
  // values (n) in falling order, R (n, width) by rows, zero beyond n. Its memory is kept from call to call.
  void solve(const double* poles, const double* z, int n, int width, double* values, double* R);

 private:
  struct Turn {
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
  std::vector<Turn> turns_;
};

}  // namespace pilotfish
