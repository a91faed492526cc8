#include "orientations.hpp"

#include <cmath>

#include "lanes.hpp"

namespace pilotfish {

namespace {

// Returns 2 a / sin a for the angle a with this (scaled) sine and cosine, both at least 0. The tangent of a /
// 2 is at most one; its arc tangent less a multiple of pi / 8 is within pi / 16, where eleven terms of the
// Taylor series suffice. Without branches, so that loops vectorise.
inline double double_angle_over_sine(double sine, double cosine) {
  constexpr double TAN_1 = 0.19891236737965800691,
                   TAN_2 = 0.41421356237309504880;  // tangents of 1, 2, 3 pi / 16
  constexpr double TAN_3 = 0.66817863791929891999, EIGHTH = 0.39269908169872415481;  // pi / 8
  const double half = sine / (cosine + std::sqrt(sine * sine + cosine * cosine));
  const double table_tangent = half > TAN_3 ? 1.0 : (half > TAN_1 ? TAN_2 : 0.0);
  const double angle = half > TAN_3 ? 2.0 * EIGHTH : (half > TAN_1 ? EIGHTH : 0.0);
  const double remainder = (half - table_tangent) / (1.0 + half * table_tangent);
  const double square = remainder * remainder;
  double series = 1.0 / 21;
  for (int i = 19; i >= 1; i -= 2) series = 1.0 / i - series * square;
  return sine > 0.0 ? 4.0 * (angle + remainder * series) / sine : 2.0;
}

}  // namespace

void rotation_vectors(const double* q, const double* mean, double* error) {
  const double w = mean[0], x = mean[1], y = mean[2], z = mean[3];
  for (int l = 0; l < BLOCK; ++l) {
    const double a = q[l], b = q[BLOCK + l], c = q[2 * BLOCK + l], d = q[3 * BLOCK + l];
    const double cosine = w * a + x * b + y * c + z * d;
    const double i = w * b - x * a + z * c - y * d;
    const double j = w * c - y * a + x * d - z * b;
    const double k = w * d - z * a + y * b - x * c;
    const double sine = std::sqrt(i * i + j * j + k * k);
    const double factor = double_angle_over_sine(sine, std::abs(cosine)) * (cosine < 0.0 ? -1.0 : 1.0);
    error[l] = factor * i;
    error[BLOCK + l] = factor * j;
    error[2 * BLOCK + l] = factor * k;
  }
}

}  // namespace pilotfish
