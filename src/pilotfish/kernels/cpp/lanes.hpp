// Vector registers (SIMD): fixed-size arrays of doubles, and exp and log of them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

namespace pilotfish {

// Eigen keeps arrays of a fixed size in registers; a compiler does not do so for plain loops.
#ifdef __AVX__
constexpr int REGISTER = 4;
#else
constexpr int REGISTER = 2;
#endif
constexpr int LANES = 8;   // states of a chain are padded to a multiple of this
constexpr int BLOCK = 32;  // time steps of a block, adjacent in memory
constexpr double NEVER = -std::numeric_limits<double>::infinity();  // log of probability zero

template <int N>
using Lanes = Eigen::Array<double, N, 1>;
using Buffer = std::vector<double, Eigen::aligned_allocator<double>>;

// The bits of a result must not depend on the address of an array. Eigen's sum() and prod() over a Map, a
// block or a segment begin at the first aligned entry, and an assignment to one computes the entries before
// it in another loop. Therefore Maps are copied or multiplied, but summed only if their size is fixed (Lanes)
// or by sum_in_order, and products are computed into memory that Eigen allocates.
inline double sum_in_order(const double* x, long n) {
  double sum = 0.0;
  for (long i = 0; i < n; ++i) sum += x[i];
  return sum;
}

template <int N>
inline Eigen::Map<Lanes<N>, Eigen::AlignedMax> lanes(double* at) {
  return Eigen::Map<Lanes<N>, Eigen::AlignedMax>(at);
}

template <int N>
inline Eigen::Map<const Lanes<N>, Eigen::AlignedMax> lanes(const double* at) {
  return Eigen::Map<const Lanes<N>, Eigen::AlignedMax>(at);
}

// As lanes, for any address.
template <int N>
inline Eigen::Map<Lanes<N>, Eigen::Unaligned> loose_lanes(double* at) {
  return Eigen::Map<Lanes<N>, Eigen::Unaligned>(at);
}

template <int N>
inline Eigen::Map<const Lanes<N>, Eigen::Unaligned> loose_lanes(const double* at) {
  return Eigen::Map<const Lanes<N>, Eigen::Unaligned>(at);
}

inline double as_real(uint64_t bits) {
  double real;
  std::memcpy(&real, &bits, sizeof real);
  return real;
}

inline uint64_t as_bits(double real) {
  uint64_t bits;
  std::memcpy(&bits, &real, sizeof bits);
  return bits;
}

constexpr double LN2_HIGH = 0x1.62e42feep-1;  // few enough bits that integer multiples up to 2^11 are exact
constexpr double LN2_LOW = 0x1.a39ef35793c76p-33;

// Returns exp(x) for x <= 0, to one unit in the last place; zero below -708, where results would be
// subnormal. x = n log 2 + f with |f| <= log(2) / 2, and the Taylor series of exp(f). Without branches, so
// that loops vectorise.
inline double exponential(double x) {
  // clang-format off
  constexpr double INVERSE_FACTORIAL[] = {
      1.0, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880,
      1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800.0};
  // clang-format on
  constexpr double ROUND = 0x1.8p52;  // adding it puts the nearest integer into the low bits
  const double clipped = x < -708.0 ? -708.0 : x;
  const double rounded = clipped * 0x1.71547652b82fep0 + ROUND;  // x / log 2
  const double n = rounded - ROUND;
  const double f = (clipped - n * LN2_HIGH) - n * LN2_LOW;
  double series = INVERSE_FACTORIAL[13];
  for (int i = 12; i >= 0; --i) series = series * f + INVERSE_FACTORIAL[i];
  const double power = as_real((as_bits(rounded) + 1023) << 52);  // 2^n
  return x < -708.0 ? 0.0 : series * power;
}

// Returns log(x) for normal x > 0, to one unit in the last place: x = 2^n m with m in [1/sqrt 2, sqrt 2), and
// the series of log m = 2 artanh(s), s = (m - 1) / (m + 1). Without branches, so that loops vectorise.
inline double logarithm(double x) {
  constexpr uint64_t ROOT_HALF = 0x3fe6a09e667f3bcdULL;  // 1 / sqrt 2
  constexpr uint64_t EXPONENT = 0xfff0000000000000ULL;
  const uint64_t above = as_bits(x) - ROOT_HALF;
  const double m = as_real(as_bits(x) - (above & EXPONENT));
  const double n = as_real(((above >> 52) ^ 0x800) | 0x4330000000000000ULL) - (0x1p52 + 0x800);
  const double g = m - 1.0;
  const double s = g / (2.0 + g);
  const double z = s * s;
  double series = 2.0 / 19;
  for (int i = 17; i >= 3; i -= 2) series = series * z + 2.0 / i;
  // 2 s = g - s g, and s g = half - s half, which keeps the rounding error of g
  const double half = 0.5 * g * g;
  return n * LN2_HIGH - ((half - (s * (half + z * series) + n * LN2_LOW)) - g);
}

// Computes y = exp(x - shift), for a width that is a multiple of LANES.
inline void exponentials(const double* x, double shift, double* y, int width) {
  for (int c = 0; c < width; c += LANES)
    for (int i = c; i < c + LANES; ++i) y[i] = exponential(x[i] - shift);
}

inline void logarithms(const double* x, double* y, int width) {
  for (int c = 0; c < width; c += LANES)
    for (int i = c; i < c + LANES; ++i) y[i] = logarithm(x[i]);
}

inline double largest(const double* x, int width) {
  Lanes<LANES> most = lanes<LANES>(x);
  for (int c = LANES; c < width; c += LANES) most = most.max(lanes<LANES>(x + c));
  return most.maxCoeff();
}

inline double smallest(const double* x, int width) {
  Lanes<LANES> least = lanes<LANES>(x);
  for (int c = LANES; c < width; c += LANES) least = least.min(lanes<LANES>(x + c));
  return least.minCoeff();
}

inline double total(const double* x, int width) {
  Lanes<LANES> sum = lanes<LANES>(x);
  for (int c = LANES; c < width; c += LANES) sum += lanes<LANES>(x + c);
  return sum.sum();
}

}  // namespace pilotfish
