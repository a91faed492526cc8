#include "manifold.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double SMALL_ANGLE = 1e-2;  // rad; below, series are more exact

double norm(const double* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Writes 2 log(base* x) for the nearer of x and -x.
void rotation_vector(const double* base, const double* x, double* v) {
  const double conjugate[] = {base[0], -base[1], -base[2], -base[3]};
  double relative[4];
  multiply(conjugate, x, relative);
  const double sign = relative[0] < 0.0 ? -1.0 : 1.0;
  const double sine = norm(relative + 1);
  const double scale = sign * (sine > 0.0 ? 2.0 * std::atan2(sine, sign * relative[0]) / sine : 2.0);
  for (int i = 0; i < 3; ++i) v[i] = relative[1 + i] * scale;
}

// Writes base exp(v / 2).
void rotate(const double* base, const double* v, double* x) {
  const double half[] = {0.5 * v[0], 0.5 * v[1], 0.5 * v[2]};
  const double angle = norm(half), scale = angle > 0.0 ? std::sin(angle) / angle : 1.0;
  const double turn[] = {std::cos(angle), half[0] * scale, half[1] * scale, half[2] * scale};
  multiply(base, turn, x);
}

}  // namespace

void multiply(const double* p, const double* q, double* product) {
  const double w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
  const double x = p[0] * q[1] + q[0] * p[1] + p[2] * q[3] - p[3] * q[2];
  const double y = p[0] * q[2] + q[0] * p[2] + p[3] * q[1] - p[1] * q[3];
  const double z = p[0] * q[3] + q[0] * p[3] + p[1] * q[2] - p[2] * q[1];
  product[0] = w, product[1] = x, product[2] = y, product[3] = z;
}

void deviation(const Manifold& manifold, const double* base, const double* x, double* v) {
  int column = 0;
  for (int start : manifold.orientation_starts) {
    for (; column < start; ++column) *v++ = x[column] - base[column];
    rotation_vector(base + start, x + start, v);
    v += 3, column += 4;
  }
  for (; column < manifold.D; ++column) *v++ = x[column] - base[column];
}

void displace(const Manifold& manifold, const double* base, const double* v, double* x) {
  int column = 0;
  for (int start : manifold.orientation_starts) {
    for (; column < start; ++column) x[column] = base[column] + *v++;
    rotate(base + start, v, x + start);
    v += 3, column += 4;
  }
  for (; column < manifold.D; ++column) x[column] = base[column] + *v++;
}

void displacement_jacobian(const Manifold& manifold, const double* v, double* J) {
  const int E = manifold.E();
  std::fill_n(J, E * E, 0.0);
  for (int i = 0; i < E; ++i) J[i * E + i] = 1.0;
  for (size_t n = 0; n < manifold.orientation_starts.size(); ++n) {
    const int start = manifold.orientation_starts[n] - int(n);
    const double *r = v + start, a = norm(r), half = 0.5 * a;
    const double sinc = half > 0.0 ? std::sin(half) / half : 1.0;
    const double first = 0.5 * sinc * sinc;  // (1 - cos a) / a^2
    const double second = a < SMALL_ANGLE ? 1.0 / 6.0 - a * a / 120.0 + a * a * a * a / 5040.0
                                          : (a - std::sin(a)) / (a * a * a);
    const double V[3][3] = {{0.0, -r[2], r[1]}, {r[2], 0.0, -r[0]}, {-r[1], r[0], 0.0}};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double squared = r[i] * r[j] - (i == j ? a * a : 0.0);  // V V
        J[(start + i) * E + start + j] += second * squared - first * V[i][j];
      }
  }
}

}  // namespace pilotfish
