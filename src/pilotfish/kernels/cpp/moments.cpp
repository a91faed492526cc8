#include "moments.hpp"

#include <algorithm>

namespace pilotfish {

namespace {

using Sum = Lanes<REGISTER>;

// Calls visit(i, j) for the upper left corner of each tile of 2 rows and 4 columns of the lower triangle.
template <typename Visit>
inline void for_each_tile(int E, Visit visit) {
  for (int i = 0; i < E; i += 2)
    for (int j = 0; j < i + 2; j += 4) visit(i, j);
}

// Adds left[r] right[c], summed over the steps of a block, to REGISTER partial sums of sum[r][c].
inline void add_tile(const double* left, const double* right, double* sum) {
  Sum s00 = lanes<REGISTER>(sum), s01 = lanes<REGISTER>(sum + REGISTER);
  Sum s02 = lanes<REGISTER>(sum + 2 * REGISTER), s03 = lanes<REGISTER>(sum + 3 * REGISTER);
  Sum s10 = lanes<REGISTER>(sum + 4 * REGISTER), s11 = lanes<REGISTER>(sum + 5 * REGISTER);
  Sum s12 = lanes<REGISTER>(sum + 6 * REGISTER), s13 = lanes<REGISTER>(sum + 7 * REGISTER);
  for (int l = 0; l < BLOCK; l += REGISTER) {
    const Sum a = lanes<REGISTER>(left + l), b = lanes<REGISTER>(left + BLOCK + l);
    const Sum c = lanes<REGISTER>(right + l), d = lanes<REGISTER>(right + BLOCK + l);
    const Sum e = lanes<REGISTER>(right + 2 * BLOCK + l), f = lanes<REGISTER>(right + 3 * BLOCK + l);
    s00 += a * c, s01 += a * d, s02 += a * e, s03 += a * f;
    s10 += b * c, s11 += b * d, s12 += b * e, s13 += b * f;
  }
  lanes<REGISTER>(sum) = s00, lanes<REGISTER>(sum + REGISTER) = s01;
  lanes<REGISTER>(sum + 2 * REGISTER) = s02, lanes<REGISTER>(sum + 3 * REGISTER) = s03;
  lanes<REGISTER>(sum + 4 * REGISTER) = s10, lanes<REGISTER>(sum + 5 * REGISTER) = s11;
  lanes<REGISTER>(sum + 6 * REGISTER) = s12, lanes<REGISTER>(sum + 7 * REGISTER) = s13;
}

size_t tiles(int E) {
  size_t count = 0;
  for_each_tile(E, [&](int, int) { ++count; });
  return count;
}

}  // namespace

Moments::Moments(const Sizes& sizes, const double* means, double* offsets, double* scatter_matrices)
    : sizes_(sizes),
      means_(means),
      offsets_(offsets),
      scatters_(scatter_matrices),
      page_(sizes),
      error_(size_t(sizes.rows()) * BLOCK),
      weighted_(size_t(sizes.rows()) * BLOCK),
      first_(size_t(sizes.E()) * REGISTER),
      second_(tiles(sizes.E()) * 8 * REGISTER) {
  const size_t states = size_t(sizes.P) * sizes.K;
  std::fill_n(offsets, states * sizes.E(), 0.0);
  std::fill_n(scatter_matrices, states * sizes.E() * sizes.E(), 0.0);
}

void Moments::add(const double* x, long begin, long end, const double* gamma, long stride,
                  const double* min_weights) {
  for (; begin < end; begin += STEPS, gamma += STEPS * stride) {
    for (int p = 0; p < sizes_.P; ++p) {
      page_.read(x + (p * sizes_.N + begin) * sizes_.D, std::min<long>(STEPS, end - begin));
      for (int k = 0; k < sizes_.K; ++k)
        add_state(size_t(p) * sizes_.K + k, gamma + k, stride, min_weights[k]);
    }
  }
}

void Moments::add_state(size_t state, const double* gamma, long stride, double min_weight) {
  alignas(64) double weights[BLOCK];
  bool any = false;
  for (long b = 0; b < page_.blocks(); ++b) {
    std::fill_n(weights, BLOCK, 0.0);
    for (long l = 0; l < page_.steps_in(b); ++l) {
      const double weight = gamma[(b * BLOCK + l) * stride];
      weights[l] = weight < min_weight ? 0.0 : weight;
    }
    if (std::all_of(weights, weights + BLOCK, [](double weight) { return weight == 0.0; })) continue;
    deviations(page_.block(b), means_ + state * sizes_.D, sizes_, error_.data());
    add_block(weights);
    any = true;
  }
  if (any) collect(state);
}

void Moments::add_block(const double* weights) {
  const double* error = error_.data();
  double* weighted = weighted_.data();
  for (int i = 0; i < sizes_.E(); ++i) {
    Sum sum = lanes<REGISTER>(first_.data() + i * REGISTER);
    for (int l = 0; l < BLOCK; l += REGISTER) {
      const Sum product = lanes<REGISTER>(weights + l) * lanes<REGISTER>(error + i * BLOCK + l);
      lanes<REGISTER>(weighted + i * BLOCK + l) = product;
      sum += product;
    }
    lanes<REGISTER>(first_.data() + i * REGISTER) = sum;
  }
  double* sum = second_.data();
  for_each_tile(sizes_.E(), [&](int i, int j) {
    add_tile(weighted + i * BLOCK, error + j * BLOCK, sum);
    sum += 8 * REGISTER;
  });
}

void Moments::collect(size_t state) {
  const int E = sizes_.E();
  for (int i = 0; i < E; ++i) offsets_[state * E + i] += lanes<REGISTER>(first_.data() + i * REGISTER).sum();
  double* scatter = scatters_ + state * E * E;
  const double* sum = second_.data();
  for_each_tile(E, [&](int i, int j) {
    for (int r = i; r < i + 2; ++r)
      for (int c = j; c < j + 4; ++c, sum += REGISTER)
        if (r < E && c <= r) scatter[r * E + c] += lanes<REGISTER>(sum).sum();
  });
  std::fill(first_.begin(), first_.end(), 0.0);
  std::fill(second_.begin(), second_.end(), 0.0);
}

void Moments::finish() {
  const int E = sizes_.E();
  for (size_t state = 0; state < size_t(sizes_.P) * sizes_.K; ++state)
    for (int i = 0; i < E; ++i)
      for (int j = 0; j < i; ++j) scatters_[(state * E + j) * E + i] = scatters_[(state * E + i) * E + j];
}

}  // namespace pilotfish
