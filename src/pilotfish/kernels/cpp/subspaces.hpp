// Subspace of a cluster in one frame: its updates by a datapoint and by another cluster.
// Defined by kernels/reference/subspaces.py.
#pragma once

#include "lanes.hpp"
#include "rank_one.hpp"

namespace pilotfish {

inline int round_up_to_four(int n) { return (n + 3) / 4 * 4; }

// Subspace inside a packed row. Mean, distances and the capacity for directions are padded with zeros to a
// multiple of four, the width of a vector register.
struct Subspace {
  double *dimension, *rank, *mean, *variances, *distances, *basis;
};

struct Layout {
  int D;         // columns
  int rows;      // D padded to a multiple of four
  int capacity;  // number of directions, a multiple of four
  size_t block() const { return 2 + size_t(rows) + 2 * capacity + 4 + size_t(D) * capacity; }
  Subspace at(double* block) const {
    double* variances = block + 2 + rows;
    return {block, block + 1, block + 2, variances, variances + capacity, variances + 2 * capacity + 4};
  }
};

// Returns 2 rho - rho^2 for a datapoint at this squared distance from the mean.
inline double projection_weight(double square, double bandwidth) {
  const double rho = exponential(-square / bandwidth);
  return rho * (2.0 - rho);
}

// Computes error = x - mean; returns its squared length.
inline double deviation(const double* x, const double* mean, int rows, double* error) {
  Lanes<4> sum = Lanes<4>::Zero();
  for (int d = 0; d < rows; d += 4) {
    const Lanes<4> e = loose_lanes<4>(x + d) - loose_lanes<4>(mean + d);
    loose_lanes<4>(error + d) = e;
    sum += e * e;
  }
  return sum.sum();
}

// Returns |a - b|^2, or a partial sum that is at least limit.
inline double bounded_squared_distance(const double* a, const double* b, int rows, double limit) {
  double square = 0.0;
  for (int d = 0; d < rows && square < limit; d += 4)
    square += (loose_lanes<4>(a + d) - loose_lanes<4>(b + d)).square().sum();
  return square;
}

// Computes g = U^T e for COLUMNS directions, in four independent chains of additions.
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

// Computes g = U^T e for the first directions, a multiple of four.
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

struct UpdateSettings {
  double weight, penalty, bandwidth;
  int max_dimension, extra_directions;
};

// Updates of subspaces of one width. It keeps its memory between calls.
class Subspaces {
 public:
  explicit Subspaces(int D);

  // Updates a subspace by a datapoint; returns the change of the loss at the datapoint. If the result has
  // more directions than the capacity, the subspace is unchanged and rank() > capacity: then call keep()
  // after enlarging it.
  double update(const double* x, const Subspace& subspace, const Layout& layout,
                const UpdateSettings& settings);

  // Merges two subspaces, of which light has this fraction of the weight; keep() stores the result.
  void merge(const Subspace& heavy, const Subspace& light, const Layout& layout, double fraction,
             int extra_directions);

  int rank() const { return rank_; }  // of the last result
  void keep(const Subspace& to, const Layout& layout) const;

  // Makes the directions orthonormal again if they have drifted by more than 1e-8.
  void reorthonormalise(const Subspace& subspace, const Layout& layout);

 private:
  int augment(const double* basis, const Layout& layout, int rank, const double* y, double tolerance);
  void solve(const double* variances, int rank, int n, double scale);
  void rotate(const double* basis, const Layout& layout, int rank, int n, int kept, double* out,
              int capacity);
  template <int ROWS, int COLUMNS>
  void rotate_block(const double* basis, const Layout& layout, int rank, int n, int columns, int d, int c);
  template <int ROWS>
  void rotate_rows(const double* basis, const Layout& layout, int rank, int n, int columns, double* out,
                   int capacity, int d);
  void write_statistics(const Subspace& to, const Layout& layout) const;
  void reserve(int n);
  void reserve_wide();
  void rank_one_update(double scale, const double* y, double tolerance);

  int D_, rows_;
  Buffer error_, y_, p_, g_, correction_, values_, poles_, projections_, delta_, R_, rows_of_;
  RankOne eigenpairs_;
  // work memory of merge
  Layout wide_;
  Buffer basis_, other_, variances_, distances_, mean_, separation_;
  int rank_ = 0, dimension_ = 0;
};

}  // namespace pilotfish
