#include "densities.hpp"

#include <cmath>

#include "orientations.hpp"

namespace pilotfish {

namespace {

constexpr double LOG_TWO_PI = 1.8378770664093454836;

// Returns |W e|^2 for WIDE steps. The triangle is packed in strips of ROWS rows, each strip column by column.
template <int ROWS, int WIDE>
inline Lanes<WIDE> squared_norm(const double* triangle, const double* error, int E) {
  Lanes<WIDE> sum = Lanes<WIDE>::Zero();
  for (int i = 0; i < E; i += ROWS) {
    Lanes<WIDE> row[ROWS];
    for (int r = 0; r < ROWS; ++r) row[r].setZero();
    const int columns = std::min(i + ROWS, E);
    for (int j = 0; j < columns; ++j, triangle += ROWS) {
      const Lanes<WIDE> e = lanes<WIDE>(error + j * BLOCK);
      for (int r = 0; r < ROWS; ++r) row[r] += triangle[r] * e;
    }
    for (int r = 0; r < ROWS; ++r) sum += row[r] * row[r];
  }
  return sum;
}

template <int ROWS, int WIDE>
void squared_norms(const double* triangle, const double* error, int E, double* norms) {
  for (int c = 0; c < BLOCK; c += WIDE)
    lanes<WIDE>(norms + c) = squared_norm<ROWS, WIDE>(triangle, error + c, E);
}

// Strips of few rows waste little of a small triangle; strips of more rows use registers better in a large
// one.
constexpr int FEW_ROWS = 2, MANY_ROWS = 3, LARGE_SIZE = 24;

int strip_rows(int E) { return E < LARGE_SIZE ? FEW_ROWS : MANY_ROWS; }

size_t packed_size(int E) {
  size_t size = 0;
  for (int i = 0, rows = strip_rows(E); i < E; i += rows) size += size_t(rows) * std::min(i + rows, E);
  return size;
}

void pack(const double* precision_factor, int E, double* triangle) {
  const int rows = strip_rows(E);
  for (int i = 0; i < E; i += rows) {
    const int columns = std::min(i + rows, E);
    for (int r = 0; r < rows; ++r) {
      const int within = i + r < E ? i + r + 1 : 0;
      const double* row = precision_factor + size_t(i + r) * E;
      for (int j = 0; j < within; ++j) triangle[j * rows + r] = row[j];
      for (int j = within; j < columns; ++j) triangle[j * rows + r] = 0.0;
    }
    triangle += size_t(rows) * columns;
  }
}

}  // namespace

void Page::read(const double* x, long steps) {
  steps_ = steps;
  for (long b = 0; b < blocks(); ++b) {
    double* to = x_.data() + b * D_ * BLOCK;
    const double* from = x + b * BLOCK * D_;
    const long inside = steps_in(b);
    for (int i = 0; i < D_; ++i) {
      for (long l = 0; l < inside; ++l) to[i * BLOCK + l] = from[l * D_ + i];
      for (long l = inside; l < BLOCK; ++l) to[i * BLOCK + l] = 0.0;
    }
  }
}

namespace {

void differences(const double* block, const double* mean, int columns, double* error) {
  for (int i = 0; i < columns; ++i)
    for (int l = 0; l < BLOCK; l += LANES)
      lanes<LANES>(error + i * BLOCK + l) = lanes<LANES>(block + i * BLOCK + l) - mean[i];
}

}  // namespace

void deviations(const double* block, const double* mean, const Sizes& sizes, double* error) {
  int from = 0;
  for (int start : sizes.orientation_starts) {
    differences(block + from * BLOCK, mean + from, start - from, error);
    error += (start - from) * BLOCK;
    rotation_vectors(block + start * BLOCK, mean + start, error);
    error += 3 * BLOCK;
    from = start + 4;
  }
  differences(block + from * BLOCK, mean + from, sizes.D - from, error);
}

Densities::Densities(const Sizes& sizes, const double* means, const double* precision_cholesky)
    : sizes_(sizes),
      means_(means),
      packed_(packed_size(sizes.E())),
      triangles_(size_t(sizes.P) * sizes.K * packed_),
      constants_(size_t(sizes.P) * sizes.K),
      page_(sizes),
      error_(size_t(sizes.rows()) * BLOCK) {
  const int E = sizes.E();
  for (int p = 0; p < sizes.P; ++p)
    for (int k = 0; k < sizes.K; ++k) {
      const double* precision_factor = precision_cholesky + (size_t(p) * sizes.K + k) * E * E;
      double& constant = constants_[size_t(p) * sizes.K + k];
      constant = -0.5 * E * LOG_TWO_PI;
      for (int e = 0; e < E; ++e) constant += std::log(precision_factor[e * E + e]);
      pack(precision_factor, E, triangle(p, k));
    }
}

void Densities::evaluate(const double* x, long begin, long end, double* log_density, long stride) {
  for (; begin < end; begin += STEPS, log_density += STEPS * stride) {
    const long steps = std::min<long>(STEPS, end - begin);
    for (long n = 0; n < steps; ++n) std::fill_n(log_density + n * stride, sizes_.K, 0.0);
    for (int p = 0; p < sizes_.P; ++p) {
      page_.read(x + (p * sizes_.N + begin) * sizes_.D, steps);
      for (int k = 0; k < sizes_.K; ++k) add(p, k, log_density + k, stride);
    }
  }
}

void Densities::add(int p, int k, double* log_density, long stride) {
  const size_t state = size_t(p) * sizes_.K + k;
  const int E = sizes_.E();
  const auto norms = strip_rows(E) == FEW_ROWS ? squared_norms<FEW_ROWS, 16> : squared_norms<MANY_ROWS, 16>;
  alignas(64) double norm[BLOCK];
  for (long b = 0; b < page_.blocks(); ++b) {
    deviations(page_.block(b), means_ + state * sizes_.D, sizes_, error_.data());
    norms(triangle(p, k), error_.data(), E, norm);
    for (long l = 0; l < page_.steps_in(b); ++l)
      log_density[(b * BLOCK + l) * stride] += constants_[state] - 0.5 * norm[l];
  }
}

}  // namespace pilotfish
