#include "subspaces.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double ROUNDING = 8.0 * std::numeric_limits<double>::epsilon();
constexpr double DRIFT = 1e-8;

double square_of(const double* x, int rows) {
  Lanes<4> sum = Lanes<4>::Zero();
  for (int d = 0; d < rows; d += 4) sum += loose_lanes<4>(x + d).square();
  return sum.sum();
}

// Computes p = y - U g.
void subtract(const Layout& layout, const double* basis, int directions, const double* g, const double* y,
              double* p) {
  for (int d = 0; d < layout.D; ++d) {
    const double* u = basis + size_t(d) * layout.capacity;
    Lanes<4> sum = Lanes<4>::Zero();
    for (int c = 0; c < directions; c += 4) sum += loose_lanes<4>(u + c) * loose_lanes<4>(g + c);
    p[d] = y[d] - sum.sum();
  }
}

double extended(const double* distances, int rank, int k) { return distances[std::min(k, rank)]; }

}  // namespace

Subspaces::Subspaces(int D)
    : D_(D),
      rows_(round_up_to_four(D)),
      error_(rows_),
      y_(rows_),
      p_(rows_),
      wide_{D, rows_, round_up_to_four(D)} {
  reserve(4);
}

void Subspaces::reserve(int n) {
  const size_t width = round_up_to_four(n + 1);
  if (g_.size() >= width) return;
  for (Buffer* buffer : {&g_, &correction_, &values_, &poles_, &projections_}) buffer->resize(width);
  rows_of_.resize(4 * width);
  delta_.resize(width + 4);
  R_.resize(width * width);
}

// Computes g_ = [U p]^T y and p_, the direction of the residual of y outside U; returns the number of
// directions.
int Subspaces::augment(const double* basis, const Layout& layout, int rank, const double* y,
                       double tolerance) {
  const int directions = round_up_to_four(rank);
  reserve(rank + 1);
  std::fill(g_.begin(), g_.end(), 0.0);
  project(layout, basis, directions, y, g_.data());
  if (rank == D_) return rank;
  subtract(layout, basis, directions, g_.data(), y, p_.data());
  double left = square_of(p_.data(), rows_);
  if (rank > 0 && left < 0.5 * square_of(y, rows_)) {  // cancellation: project again (Kahan and Parlett)
    project(layout, basis, directions, p_.data(), correction_.data());
    subtract(layout, basis, directions, correction_.data(), p_.data(), p_.data());
    for (int i = 0; i < rank; ++i) g_[i] += correction_[i];
    left = square_of(p_.data(), rows_);
  }
  const double nu = std::sqrt(left);
  if (!(nu > tolerance)) return rank;
  for (int d = 0; d < D_; ++d) p_[d] /= nu;
  g_[rank] = nu;
  return rank + 1;
}

// Computes the eigenpairs of scale diag(variances, 0) + g g^T in decreasing order, and g in their basis.
void Subspaces::solve(const double* variances, int rank, int n, double scale) {
  const int width = round_up_to_four(n);
  for (int i = 0; i < n; ++i) poles_[i] = i < rank ? scale * variances[i] : 0.0;
  eigenpairs_.solve(poles_.data(), g_.data(), n, width, values_.data(), R_.data());
  std::fill_n(projections_.data(), width, 0.0);
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < width; c += 4)
      loose_lanes<4>(&projections_[c]) += g_[i] * loose_lanes<4>(&R_[size_t(i) * width + c]);
}

// Computes out = the first kept columns of [U p] R, in rows of `capacity` numbers; out may be the basis
// itself.
void Subspaces::rotate(const double* basis, const Layout& layout, int rank, int n, int kept, double* out,
                       int capacity) {
  const int width = round_up_to_four(n), columns = round_up_to_four(kept);
  for (int i = 0; i < n; ++i) std::fill_n(&R_[size_t(i) * width + kept], columns - kept, 0.0);
  int d = 0;
  for (; d + 4 <= D_; d += 4) rotate_rows<4>(basis, layout, rank, n, columns, out, capacity, d);
  for (; d < D_; ++d) rotate_rows<1>(basis, layout, rank, n, columns, out, capacity, d);
}

// ROWS rows at once, with independent sums.
template <int ROWS>
void Subspaces::rotate_rows(const double* basis, const Layout& layout, int rank, int n, int columns,
                            double* out, int capacity, int d) {
  int c = 0;
  for (; c + 8 <= columns; c += 8) rotate_block<ROWS, 8>(basis, layout, rank, n, columns, d, c);
  if (c < columns) rotate_block<ROWS, 4>(basis, layout, rank, n, columns, d, c);
  for (int row = 0; row < ROWS; ++row) {
    double* to = out + size_t(d + row) * capacity;
    for (c = 0; c < columns; c += 4) loose_lanes<4>(to + c) = loose_lanes<4>(&rows_of_[row * columns + c]);
    for (; c < capacity; c += 4) loose_lanes<4>(to + c).setZero();
  }
}

template <int ROWS, int COLUMNS>
void Subspaces::rotate_block(const double* basis, const Layout& layout, int rank, int n, int columns, int d,
                             int c) {
  const int width = round_up_to_four(n);
  const double *u = basis + size_t(d) * layout.capacity, *r = &R_[c];
  Lanes<COLUMNS> sums[ROWS];
  for (auto& sum : sums) sum.setZero();
  for (int i = 0; i < rank; ++i, r += width) {
    const Lanes<COLUMNS> along = loose_lanes<COLUMNS>(r);
    for (int row = 0; row < ROWS; ++row) sums[row] += u[row * layout.capacity + i] * along;
  }
  if (n > rank)
    for (int row = 0; row < ROWS; ++row) sums[row] += p_[d + row] * loose_lanes<COLUMNS>(r);
  for (int row = 0; row < ROWS; ++row) loose_lanes<COLUMNS>(&rows_of_[row * columns + c]) = sums[row];
}

double Subspaces::update(const double* x, const Subspace& subspace, const Layout& layout,
                         const UpdateSettings& settings) {
  const double w = settings.weight, shrink = w / (w + 1.0), fraction = std::sqrt(w) / (w + 1.0);
  const int d = int(*subspace.dimension), rank = int(*subspace.rank);
  Lanes<4> of_error = Lanes<4>::Zero(), of_x = of_error, of_mean = of_error;
  for (int i = 0; i < rows_; i += 4) {
    const Lanes<4> point = loose_lanes<4>(x + i), mean = loose_lanes<4>(subspace.mean + i), e = point - mean;
    loose_lanes<4>(&error_[i]) = e;
    of_error += e * e;
    of_x += point * point;
    of_mean += mean * mean;
  }
  const double square = of_error.sum();
  const double tolerance = ROUNDING * (std::sqrt(of_x.sum()) + std::sqrt(of_mean.sum()));
  int n = 0;
  if (settings.max_dimension + settings.extra_directions > 0)
    n = augment(subspace.basis, layout, rank, error_.data(), tolerance);
  const double inside = n ? square_of_first(g_.data(), d) : 0.0;
  const double before = std::max(square - projection_weight(square, settings.bandwidth) * inside, 0.0);
  const double loss = settings.penalty * d + before;
  for (int i = 0; i < n; ++i) g_[i] *= fraction;
  if (n) solve(subspace.variances, rank, n, shrink);

  // projections_ sqrt(w) is U^T (x - the mean after the update)
  const double after = shrink * shrink * square, near = projection_weight(after, settings.bandwidth);
  double along = 0.0, least = std::numeric_limits<double>::infinity(), now = loss;
  dimension_ = d;
  for (int k = 0; k <= n; ++k) {
    if (k) along += w * projections_[k - 1] * projections_[k - 1];
    const double delta = std::max(after - near * along, 0.0);
    delta_[k] = (w * extended(subspace.distances, rank, k) + delta) / (w + 1.0);
    const double loss_at_k = settings.penalty * k + delta;
    if (k > d + 1 || k > settings.max_dimension || !(loss_at_k <= loss || k == d)) continue;
    if (settings.penalty * k + delta_[k] < least) {
      least = settings.penalty * k + delta_[k];
      dimension_ = k;
      now = loss_at_k;
    }
  }
  rank_ = std::min(n, dimension_ + settings.extra_directions);
  if (rank_ <= layout.capacity) {
    for (int i = 0; i < rows_; i += 4)
      loose_lanes<4>(subspace.mean + i) += loose_lanes<4>(&error_[i]) / (w + 1.0);
    if (n) rotate(subspace.basis, layout, rank, n, rank_, subspace.basis, layout.capacity);
    write_statistics(subspace, layout);
  } else {
    reserve_wide();
    for (int i = 0; i < rows_; ++i) mean_[i] = subspace.mean[i] + error_[i] / (w + 1.0);
    rotate(subspace.basis, layout, rank, n, rank_, basis_.data(), wide_.capacity);
    std::copy_n(values_.data(), rank_, variances_.data());
    std::copy_n(delta_.data(), rank_ + 1, distances_.data());
  }
  return now - loss;
}

// Writes the statistics of the last update; mean and basis are in place already.
void Subspaces::write_statistics(const Subspace& to, const Layout& layout) const {
  *to.dimension = dimension_;
  *to.rank = rank_;
  std::copy_n(values_.data(), rank_, to.variances);
  std::fill_n(to.variances + rank_, layout.capacity - rank_, 0.0);
  std::copy_n(delta_.data(), rank_ + 1, to.distances);
  std::fill_n(to.distances + rank_ + 1, layout.capacity - rank_, 0.0);
}

void Subspaces::reserve_wide() {
  if (!basis_.empty()) return;
  for (Buffer* buffer : {&basis_, &other_}) buffer->resize(size_t(D_) * wide_.capacity);
  for (Buffer* buffer : {&variances_, &distances_}) buffer->resize(wide_.capacity + 4);
  for (Buffer* buffer : {&mean_, &separation_}) buffer->resize(rows_);
}

void Subspaces::rank_one_update(double scale, const double* y, double tolerance) {
  const int n = augment(basis_.data(), wide_, rank_, y, tolerance);
  if (n == 0) return;
  solve(variances_.data(), rank_, n, scale);
  rotate(basis_.data(), wide_, rank_, n, n, other_.data(), wide_.capacity);
  std::swap(basis_, other_);
  std::copy_n(values_.data(), n, variances_.data());
  rank_ = n;
}

void Subspaces::merge(const Subspace& heavy, const Subspace& light, const Layout& layout, double fraction,
                      int extra_directions) {
  reserve_wide();
  const double between = fraction * (1.0 - fraction);
  const double tolerance =
      ROUNDING * (std::sqrt(square_of(light.mean, rows_)) + std::sqrt(square_of(heavy.mean, rows_)));
  const double square = deviation(light.mean, heavy.mean, rows_, separation_.data());
  double scale = 1.0 - fraction;
  rank_ = int(*heavy.rank);
  std::copy_n(heavy.variances, rank_, variances_.data());
  std::fill(basis_.begin(), basis_.end(), 0.0);
  for (int d = 0; d < D_; ++d)
    std::copy_n(heavy.basis + size_t(d) * layout.capacity, rank_, &basis_[size_t(d) * wide_.capacity]);
  for (int i = 0; i < int(*light.rank); ++i) {
    const double length = std::sqrt(fraction * light.variances[i]);
    for (int d = 0; d < D_; ++d) y_[d] = length * light.basis[size_t(d) * layout.capacity + i];
    rank_one_update(scale, y_.data(), ROUNDING * length);
    scale = 1.0;
  }
  for (int d = 0; d < rows_; ++d) y_[d] = std::sqrt(between) * separation_[d];
  rank_one_update(scale, y_.data(), std::sqrt(between) * tolerance);
  dimension_ = int(*heavy.dimension);
  const int kept = std::min(rank_, dimension_ + extra_directions);
  double along = 0.0;
  for (int k = 0; k <= kept; ++k) {
    if (k) along += projections_[k - 1] * projections_[k - 1];
    distances_[k] = (1.0 - fraction) * extended(heavy.distances, int(*heavy.rank), k) +
                    fraction * extended(light.distances, int(*light.rank), k) +
                    std::max(between * square - along, 0.0);
  }
  rank_ = kept;
  for (int d = 0; d < rows_; ++d) mean_[d] = heavy.mean[d] + fraction * separation_[d];
}

void Subspaces::keep(const Subspace& to, const Layout& layout) const {
  std::fill_n(to.dimension, layout.block(), 0.0);
  *to.dimension = dimension_;
  *to.rank = rank_;
  std::copy_n(mean_.data(), rows_, to.mean);
  std::copy_n(variances_.data(), rank_, to.variances);
  std::copy_n(distances_.data(), rank_ + 1, to.distances);
  for (int d = 0; d < D_; ++d)
    std::copy_n(&basis_[size_t(d) * wide_.capacity], rank_, to.basis + size_t(d) * layout.capacity);
}

void Subspaces::reorthonormalise(const Subspace& subspace, const Layout& layout) {
  const int capacity = layout.capacity, rank = int(*subspace.rank);
  const auto product = [&](int i, int j) {
    double sum = 0.0;
    for (int d = 0; d < D_; ++d)
      sum += subspace.basis[size_t(d) * capacity + i] * subspace.basis[size_t(d) * capacity + j];
    return sum;
  };
  double drift = 0.0;
  for (int j = 0; j < rank; ++j)
    for (int i = 0; i <= j; ++i) drift = std::max(drift, std::abs(product(i, j) - (i == j)));
  if (!(drift > DRIFT)) return;
  for (int j = 0; j < rank; ++j) {  // modified Gram-Schmidt, twice: the leading directions do not change
    for (int pass = 0; pass < 2; ++pass)
      for (int i = 0; i < j; ++i) {
        const double along = product(i, j);
        for (int d = 0; d < D_; ++d)
          subspace.basis[size_t(d) * capacity + j] -= along * subspace.basis[size_t(d) * capacity + i];
      }
    const double length = std::sqrt(product(j, j));
    for (int d = 0; d < D_; ++d) subspace.basis[size_t(d) * capacity + j] /= length;
  }
}

}  // namespace pilotfish
