// One cluster's subspace in one frame, and what a datapoint or another cluster changes in it.
// twins/subspaces.py says what is computed.
#pragma once

#include "lanes.hpp"
#include "rank_one.hpp"

namespace pilotfish {

inline int round_up_to_four(int n) { return (n + 3) / 4 * 4; }  // the least multiple of four that is not less

// A subspace where it lies in a row of a StreamState: mean and distances are filled up with zeros to a
// multiple of four, so that vector registers need no remainder, and so is the room for directions.
struct Subspace {
  double *dimension, *rank, *mean, *variances, *distances, *basis;
};

struct Layout {
  int D;     // columns
  int rows;  // the same in fours
  int capacity;  // for directions, in fours
  size_t block() const { return 2 + size_t(rows) + 2 * capacity + 4 + size_t(D) * capacity; }
  Subspace at(double* block) const {
    double* variances = block + 2 + rows;
    return {block, block + 1, block + 2, variances, variances + capacity, variances + 2 * capacity + 4};
  }
};

// 2 rho - rho^2, for a datapoint at that squared distance from the mean.
inline double nearness(double square, double bandwidth) {
  const double rho = exponential(-square / bandwidth);
  return rho * (2.0 - rho);
}

// error = x - mean; the square of its length.
inline double deviation(const double* x, const double* mean, int rows, double* error) {
  Lanes<4> sum = Lanes<4>::Zero();
  for (int d = 0; d < rows; d += 4) {
    const Lanes<4> e = loose_lanes<4>(x + d) - loose_lanes<4>(mean + d);
    loose_lanes<4>(error + d) = e;
    sum += e * e;
  }
  return sum.sum();
}

// |a - b|^2, or some of it that is not less than limit.
inline double square_apart(const double* a, const double* b, int rows, double limit) {
  double square = 0.0;
  for (int d = 0; d < rows && square < limit; d += 4)
    square += (loose_lanes<4>(a + d) - loose_lanes<4>(b + d)).square().sum();
  return square;
}

// g = U^T e over COLUMNS directions, in four chains of additions, of which none waits for another.
template <int COLUMNS>
inline void project_block(const Layout& layout, const double* u, const double* e, double* g) {
  const int D = layout.D, capacity = layout.capacity;
  Lanes<COLUMNS> sums[4];
  for (auto& sum : sums) sum.setZero();
  int d = 0;
  for (; d + 4 <= D; d += 4, u += 4 * capacity)
    for (int i = 0; i < 4; ++i) sums[i] += loose_lanes<COLUMNS>(u + i * capacity) * e[d + i];
  for (; d < D; ++d, u += capacity) sums[0] += loose_lanes<COLUMNS>(u) * e[d];
  loose_lanes<COLUMNS>(g) = (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

// The same over the first so many directions, a multiple of four.
inline void project(const Layout& layout, const double* basis, int directions, const double* e, double* g) {
  int c = 0;
  for (; c + 8 <= directions; c += 8) project_block<8>(layout, basis + c, e, g + c);
  if (c < directions) project_block<4>(layout, basis + c, e, g + c);
}

inline double square_of_first(const double* g, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += g[i] * g[i];
  return sum;
}

struct Learning {
  double weight, penalty, bandwidth;
  int most, extra_directions;
};

// Updates of subspaces of one width. It keeps its memory: nothing is allocated once sizes have settled.
class Subspaces {
 public:
  explicit Subspaces(int D);

  // seen learns a datapoint; returns what the loss at it changes by. Where that wants more directions than
  // there is room for, seen is as it was, and rank() > room: keep() then puts it where there is room.
  double learn(const double* x, const Subspace& seen, const Layout& layout, const Learning& how);

  // heavy and light as one, light having that share of the weight; keep() puts it where it belongs.
  void merge(const Subspace& heavy, const Subspace& light, const Layout& layout, double run_groups, int extra_directions);

  int rank() const { return rank_; }  // of what was made last
  void keep(const Subspace& to, const Layout& layout) const;

  // Orthonormal directions again, where they have drifted apart by more than 1e-8.
  void reorthonormalise(const Subspace& seen, const Layout& layout);

 private:
  int augment(const double* basis, const Layout& layout, int rank, const double* y, double zero);
  void solve(const double* variances, int rank, int n, double scale);
  void rotate(const double* basis, const Layout& layout, int rank, int n, int kept, double* out, int capacity);
  template <int ROWS, int COLUMNS>
  void rotate_block(const double* basis, const Layout& layout, int rank, int n, int columns, int d, int c);
  template <int ROWS>
  void rotate_rows(const double* basis, const Layout& layout, int rank, int n, int columns, double* out,
                   int capacity, int d);
  void put(const Subspace& to, const Layout& layout) const;
  void reserve(int n);
  void reserve_wide();
  void rank_one_update(double scale, const double* y, double zero);

  int D_, rows_;
  Buffer error_, y_, p_, g_, again_, values_, poles_, along_, delta_, R_, rows_of_;
  RankOne eigenpairs_;
  // what merge works on
  Layout wide_;
  Buffer basis_, other_, variances_, distances_, mean_, apart_;
  int rank_ = 0, dimension_ = 0;
};

}  // namespace pilotfish
