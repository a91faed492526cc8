// Exponential and logarithmic maps of R^n x S^3 x ... Defined by kernels/reference/manifold.py.
#pragma once

#include <vector>

namespace pilotfish {

// Points of D columns, some of which are unit quaternions; tangent vectors have E.
struct Manifold {
  int D;
  std::vector<int> orientation_starts;  // first column of each quaternion, increasing

  int E() const { return D - int(orientation_starts.size()); }
};

// Writes the Hamilton product p q; the product may be p or q.
void multiply(const double* p, const double* q, double* product);

// Writes the tangent vector v (E) at base (D) whose geodesic reaches x (D).
void deviation(const Manifold& manifold, const double* base, const double* x, double* v);

// Writes the point x (D) that the geodesic from base (D) along v (E) reaches; x may be base.
void displace(const Manifold& manifold, const double* base, const double* v, double* x);

// Writes J (E, E) with displace(base, v + h) = displace(displace(base, v), J h) to first order in h.
void displacement_jacobian(const Manifold& manifold, const double* v, double* J);

}  // namespace pilotfish
