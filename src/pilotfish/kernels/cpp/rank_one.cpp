#include "rank_one.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double EPS = std::numeric_limits<double>::epsilon();
constexpr int MOST_STEPS = 100;  // of which bisection alone would need 64

}  // namespace

void RankOne::reserve(int n) {
  if (int(d_.size()) >= n) return;
  for (Buffer* buffer : {&d_, &z_, &pole_, &weight_, &shift_, &true_z_, &vector_, &all_}) buffer->resize(n);
  gap_.resize(size_t(n) * n);
  kept_.resize(n);
  order_.resize(n);
  turns_.reserve(n);
}

// Leaves in kept_ the places of the m poles that are still coupled; the others are eigenpairs of their own.
int RankOne::deflate(int n) {
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += z_[i] * z_[i];
  const double tiny = 8.0 * EPS * std::max(d_[0], square), length = std::sqrt(square);
  turns_.clear();
  int m = 0;
  for (int i = 0; i < n; ++i) {
    if (std::abs(z_[i]) * length <= tiny) {
      z_[i] = 0.0;
      continue;
    }
    if (m > 0) {
      const int before = kept_[m - 1];
      const double r = std::hypot(z_[before], z_[i]), c = z_[i] / r, s = z_[before] / r;
      const double apart = d_[before] - d_[i];
      if (apart * std::abs(c * s) <= tiny) {  // turned so that the former is coupled no longer
        turns_.push_back({before, i, c, s});
        z_[i] = r;
        z_[before] = 0.0;
        const double upper = d_[before], lower = d_[i];
        d_[before] = upper * c * c + lower * s * s;
        d_[i] = upper * s * s + lower * c * c;
        kept_[m - 1] = i;
        continue;
      }
    }
    kept_[m++] = i;
  }
  return m;
}

// shift_[k]: the root above pole k, and gap_ row k: the poles' distances from it.
void RankOne::root(int k, int m) {
  double* gap = &gap_[size_t(k) * m];
  double upper = 0.0;  // where the root is less than
  if (k == 0) {
    for (int j = 0; j < m; ++j) upper += weight_[j];
  } else {
    upper = pole_[k - 1] - pole_[k];
  }
  double origin = pole_[k], low = 0.0, high = upper;
  if (k > 0) {  // from the nearer pole, so that no digit of the distance to it is lost
    double middle = 1.0;
    for (int j = 0; j < m; ++j) middle += weight_[j] / ((pole_[j] - pole_[k]) - 0.5 * upper);
    if (middle < 0.0) {
      origin = pole_[k - 1];
      low = -0.5 * upper;
      high = 0.0;
    } else {
      high = 0.5 * upper;
    }
  }
  const double left = pole_[k] - origin, right = k ? pole_[k - 1] - origin : 0.0;
  double x = k == 0 ? std::min(weight_[0], 0.5 * upper) : 0.5 * (low + high);
  if (!(x > low && x < high)) x = 0.5 * (low + high);
  for (int step = 0; step < MOST_STEPS; ++step) {
    double below = 0.0, above = 0.0, slope_below = 0.0, slope_above = 0.0;
    for (int j = k; j < m; ++j) {
      const double inverse = 1.0 / ((pole_[j] - origin) - x), term = weight_[j] * inverse;
      below += term;
      slope_below += term * inverse;
    }
    for (int j = 0; j < k; ++j) {
      const double inverse = 1.0 / ((pole_[j] - origin) - x), term = weight_[j] * inverse;
      above += term;
      slope_above += term * inverse;
    }
    const double f = 1.0 + below + above;
    if (std::abs(f) <= 2.0 * EPS * m * (1.0 - below + above)) break;
    (f < 0.0 ? low : high) = x;
    // 1 + p + q / (left - x) + r + s / (right - x), which has the same values and slopes here
    const double a = left - x, b = right - x;
    double next;
    if (k == 0) {
      const double q = slope_below * a * a, p = 1.0 + below - slope_below * a;
      next = left + q / p;
    } else {
      const double q = slope_below * a * a, s = slope_above * b * b;
      const double c = f - slope_below * a - slope_above * b;
      // c t^2 - B t + C = 0 for the step t from x: (a - t)(b - t) c + q (b - t) + s (a - t) = 0
      const double B = c * (a + b) + q + s, C = c * a * b + q * b + s * a;
      const double root = std::sqrt(std::max(B * B - 4.0 * c * C, 0.0));
      const double t = B >= 0.0 ? 2.0 * C / (B + root) : (B - root) / (2.0 * c);
      next = x + t;
    }
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == x || !(high > low)) break;
    x = next;
  }
  shift_[k] = origin + x;
  for (int j = 0; j < m; ++j) gap[j] = (pole_[j] - origin) - x;
}

void RankOne::vectors(int n, int m, int width, double* values, double* R) {
  for (int j = 0; j < m; ++j) {  // |z_j|^2 = prod (value_k - pole_j) / prod (pole_k - pole_j)
    double square = -gap_[size_t(j) * m + j];
    for (int k = 0; k < m; ++k)
      if (k != j) square *= gap_[size_t(k) * m + j] / (pole_[j] - pole_[k]);
    true_z_[j] = std::copysign(std::sqrt(std::max(square, 0.0)), z_[kept_[j]]);
  }
  for (int i = 0; i < n; ++i) {
    order_[i] = i;
    all_[i] = d_[i];
  }
  for (int k = 0; k < m; ++k) all_[kept_[k]] = shift_[k];
  std::sort(order_.begin(), order_.begin() + n, [&](int a, int b) { return all_[a] > all_[b]; });
  std::fill_n(R, size_t(n) * width, 0.0);
  for (int column = 0; column < n; ++column) {
    const int own = order_[column];
    values[column] = std::max(all_[own], 0.0);
    const int* place = std::find(kept_.data(), kept_.data() + m, own);
    if (place == kept_.data() + m) {
      R[size_t(own) * width + column] = 1.0;
      continue;
    }
    const double* gap = &gap_[size_t(place - kept_.data()) * m];
    double square = 0.0;
    for (int j = 0; j < m; ++j) {
      vector_[j] = true_z_[j] / gap[j];
      square += vector_[j] * vector_[j];
    }
    const double scale = 1.0 / std::sqrt(square);
    for (int j = 0; j < m; ++j) R[size_t(kept_[j]) * width + column] = scale * vector_[j];
  }
  for (size_t t = turns_.size(); t-- > 0;) {
    const Turn& turn = turns_[t];
    double *one = R + size_t(turn.i) * width, *other = R + size_t(turn.j) * width;
    for (int column = 0; column < n; ++column) {
      const double u = one[column], v = other[column];
      one[column] = turn.c * u + turn.s * v;
      other[column] = turn.c * v - turn.s * u;
    }
  }
}

void RankOne::solve(const double* poles, const double* z, int n, int width, double* values, double* R) {
  reserve(n);
  std::copy_n(poles, n, d_.data());
  std::copy_n(z, n, z_.data());
  const int m = deflate(n);
  for (int k = 0; k < m; ++k) {
    pole_[k] = d_[kept_[k]];
    weight_[k] = z_[kept_[k]] * z_[kept_[k]];
  }
  for (int k = 0; k < m; ++k) root(k, m);
  vectors(n, m, width, values, R);
}

}  // namespace pilotfish
