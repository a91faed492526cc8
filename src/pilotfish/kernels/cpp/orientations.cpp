#include "orientations.hpp"

#include <cmath>

#include "lanes.hpp"

namespace pilotfish {

namespace {

// Twice the angle whose sine and cosine, both positive, are in this ratio, over the sine. The tangent of
// half the angle is at most one; less a multiple of pi / 8 its arc tangent is within pi / 16, where Taylor's
// series ends after eleven terms. No branch: loops vectorise.
inline double turn_over_sine(double sine, double cosine) {
  constexpr double TAN_1 = 0.19891236737965800691, TAN_2 = 0.41421356237309504880;  // of 1, 2, 3 pi / 16
  constexpr double TAN_3 = 0.66817863791929891999, EIGHTH = 0.39269908169872415481;  // pi / 8
  const double half = sine / (cosine + std::sqrt(sine * sine + cosine * cosine));
  const double known = half > TAN_3 ? 1.0 : (half > TAN_1 ? TAN_2 : 0.0);
  const double angle = half > TAN_3 ? 2.0 * EIGHTH : (half > TAN_1 ? EIGHTH : 0.0);
  const double rest = (half - known) / (1.0 + half * known);
  const double square = rest * rest;
  double series = 1.0 / 21;
  for (int i = 19; i >= 1; i -= 2) series = 1.0 / i - series * square;
  return sine > 0.0 ? 4.0 * (angle + rest * series) / sine : 2.0;
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
    const double turn = turn_over_sine(sine, std::abs(cosine)) * (cosine < 0.0 ? -1.0 : 1.0);
    error[l] = turn * i;
    error[BLOCK + l] = turn * j;
    error[2 * BLOCK + l] = turn * k;
  }
}

}  // namespace pilotfish
