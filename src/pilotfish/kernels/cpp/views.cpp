#include "views.hpp"

#include <cmath>

#include "turns.hpp"

namespace pilotfish {

namespace {

constexpr int CHUNK = 16;  // steps whose sums stay in registers; a multiple of every register
constexpr double LOG_TWO_PI = 1.8378770664093454836;

// |W e|^2 for CHUNK steps. The triangle comes in strips of two rows, each strip column by column.
inline Lanes<CHUNK> squared_norm(const double* triangle, const double* error, int E) {
  Lanes<CHUNK> sum = Lanes<CHUNK>::Zero();
  for (int i = 0; i < E; i += 2) {
    Lanes<CHUNK> upper = Lanes<CHUNK>::Zero(), lower = Lanes<CHUNK>::Zero();
    for (int j = 0; j < i + 2; ++j, triangle += 2) {
      const auto e = lanes<CHUNK>(error + j * BLOCK);
      upper += triangle[0] * e;
      lower += triangle[1] * e;
    }
    sum += upper * upper + lower * lower;
  }
  return sum;
}

void pack(const double* whitener, int E, double* triangle) {
  for (int i = 0; i < E; i += 2)
    for (int j = 0; j < i + 2; ++j)
      for (int r = i; r < i + 2; ++r) *triangle++ = (r < E && j <= r) ? whitener[r * E + j] : 0.0;
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
  for (int turn : sizes.turns) {
    differences(block + from * BLOCK, mean + from, turn - from, error);
    error += (turn - from) * BLOCK;
    rotation_vectors(block + turn * BLOCK, mean + turn, error);
    error += 3 * BLOCK;
    from = turn + 4;
  }
  differences(block + from * BLOCK, mean + from, sizes.D - from, error);
}

Densities::Densities(const Sizes& sizes, const double* means, const double* whiteners)
    : sizes_(sizes),
      means_(means),
      packed_(size_t(sizes.E() + 1) * (sizes.E() + 3) / 2),
      triangles_(size_t(sizes.P) * sizes.K * packed_),
      constants_(size_t(sizes.P) * sizes.K),
      page_(sizes),
      error_(size_t(sizes.rows()) * BLOCK) {
  const int E = sizes.E();
  for (int p = 0; p < sizes.P; ++p)
    for (int k = 0; k < sizes.K; ++k) {
      const double* whitener = whiteners + (size_t(p) * sizes.K + k) * E * E;
      double& constant = constants_[size_t(p) * sizes.K + k];
      constant = -0.5 * E * LOG_TWO_PI;
      for (int e = 0; e < E; ++e) constant += std::log(whitener[e * E + e]);
      pack(whitener, E, triangle(p, k));
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
  alignas(64) double density[BLOCK];
  for (long b = 0; b < page_.blocks(); ++b) {
    deviations(page_.block(b), means_ + state * sizes_.D, sizes_, error_.data());
    for (int c = 0; c < BLOCK; c += CHUNK)
      lanes<CHUNK>(density + c) =
          constants_[state] - 0.5 * squared_norm(triangle(p, k), error_.data() + c, E);
    for (long l = 0; l < page_.steps_in(b); ++l) log_density[(b * BLOCK + l) * stride] += density[l];
  }
}

}  // namespace pilotfish
