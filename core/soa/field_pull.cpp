#include "core/soa/field_pull.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/abi/field_family.hpp"

namespace cardan::soa {

int ask_field(const FieldSource& f, const FieldMoment& when, int n, const double* points, double* values, double* gradients) {
  const cardan_field_family& family = *f.family;
  const cardan_field_args args{sizeof args, when.t, f.packed.data(), when.prepared};
  const bool own = (family.facts & CARDAN_FIELD_GRADIENT) != 0;
  int code = when.beyond | family.evaluate(&args, static_cast<std::uint32_t>(n), points, values, own ? gradients : nullptr);
  if (own || !gradients) return code;
  // It varies over some thousandth of the distance at least.
  const auto size = static_cast<int>(field_size(family.quantity));
  const double least = family.distance > 0.0 ? family.distance : 1.0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 3; ++j) {
      const double* x = points + 3 * i;
      double slope[CARDAN_FIELD_NUMBERS], work[CARDAN_FIELD_NUMBERS];
      derivative(
          [&](double s, double* to) {
            double moved[3] = {x[0], x[1], x[2]};
            moved[j] += s;
            code |= family.evaluate(&args, 1, moved, to, nullptr);
          },
          1e-3 * std::max(least, std::hypot(x[0], x[1], x[2])), size, slope, work);
      for (int k = 0; k < size; ++k) gradients[3 * (size * i + k) + j] = slope[k];
    }
  return code;
}

namespace detail {
namespace {

constexpr int kValues = CARDAN_FIELD_NUMBERS, kGradients = 3 * kValues;
/// Of the length |a| / |da/dr| over which the field varies: steps of differences, of second order for d^2a/dr^2, of eighth for derivatives.
constexpr double kSmall = 1e-5, kStep = 1e-2, kLongest = 1e100;

/// Values and, where they are wanted, gradients at n points; false beyond what the field knows.
bool ask(const FieldSource& f, const FieldMoment* at, int n, const double* points, double* values, double* gradients) {
  const FieldMoment start{0.0, f.prepared.empty() ? nullptr : f.prepared.data(), 0};
  return !f.refuses(ask_field(f, at ? *at : start, n, points, values, gradients));
}

double largest(const double* x, int n) {
  double most = 0.0;
  for (int i = 0; i < n; ++i) most = std::max(most, std::abs(x[i]));
  return most;
}

/// |a| / |da/dr| [m]; infinite in a uniform field.
double length_of(const double* a, const double* G) {
  const double slope = largest(G, 9);
  return slope > 0.0 ? largest(a, 3) / slope : std::numeric_limits<double>::infinity();
}

}  // namespace

void acceleration(const GravityField& g, const FieldMoment* at, const double* point, double* a, double* gradient) {
  double values[kValues], gradients[kGradients];
  if (!ask(*g.source, at, 1, point, values, gradients)) {
    std::fill_n(values, kValues, std::numeric_limits<double>::quiet_NaN());
    std::fill_n(gradients, kGradients, std::numeric_limits<double>::quiet_NaN());
  }
  std::copy_n(values, 3, a), std::copy_n(gradients, 9, gradient);
}

// The potential of a body to second order in its size, m U - 1/2 G : S (MacCullagh 1855), and the force and torque that belong to it.
void pull(const GravityField& g, const FieldMoment* at, const double* body, double* out) {
  const double m = body[0], *x = body + 1;
  const double S[9] = {body[4], body[7], body[8], body[7], body[5], body[9], body[8], body[9], body[6]};
  double values[kValues], G[kGradients];
  std::fill_n(out, kPullNumbers, 0.0);
  if (!ask(*g.source, at, 1, x, values, g.gradient ? G : nullptr)) {
    std::fill_n(out, kPullNumbers, std::numeric_limits<double>::quiet_NaN());
    return;
  }
  for (int i = 0; i < 3; ++i) out[i] = m * values[i];
  out[15] = m * values[3];
  if (!g.gradient) return;
  // Sum of m rho x (G rho): the odd part of S G*.
  const auto SG = [&](int i, int j) { return S[3 * i] * G[3 * j] + S[3 * i + 1] * G[3 * j + 1] + S[3 * i + 2] * G[3 * j + 2]; };
  out[3] = SG(1, 2) - SG(2, 1), out[4] = SG(2, 0) - SG(0, 2), out[5] = SG(0, 1) - SG(1, 0);
  std::copy_n(G, 9, out + 6);
  for (int i = 0; i < 9; ++i) out[15] -= 0.5 * G[i] * S[i];
  // 1/2 sum of d^2 a_i / dr_j dr_k S_jk, by differences of G along axis j of what stands with d/dr_j: mixed derivatives once, along the
  // first of their axes. Where a has neither sources nor curl, its Laplacian is 0, so S less S_zz is as good: nothing is left along z.
  const double h = kSmall * length_of(values, G);
  if (!std::isfinite(h) || !(h > 0.0)) return;
  const unsigned facts = g.source->family->facts;
  const bool harmonic = (facts & CARDAN_FIELD_SOURCE_FREE) != 0 && (facts & (CARDAN_FIELD_CURL_FREE | CARDAN_FIELD_POTENTIAL)) != 0;
  const double less = harmonic ? S[8] : 0.0;
  const double along[9] = {S[0] - less, 2.0 * S[1], 2.0 * S[2], 0.0, S[4] - less, 2.0 * S[5], 0.0, 0.0, S[8]};
  const int axes = harmonic ? 2 : 3;
  double points[18], there[6 * kValues], slopes[6 * kGradients];
  for (int j = 0; j < axes; ++j)
    for (const int side : {0, 1}) {
      double* p = points + 3 * (2 * j + side);
      std::copy_n(x, 3, p);
      p[j] += side == 0 ? h : -h;
    }
  if (!ask(*g.source, at, 2 * axes, points, there, slopes)) return;  // at the very end of what it knows: to first order
  for (int j = 0; j < axes; ++j) {
    const double *up = slopes + kGradients * (2 * j), *down = up + kGradients;
    const double width = points[6 * j + j] - points[6 * j + 3 + j];  // as it came out in doubles
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) out[i] += 0.5 * (up[3 * i + k] - down[3 * i + k]) / width * along[3 * j + k];
  }
}

void pull_along(const GravityField& g, const FieldMoment* at, const double* body, const double* rate, double* out) {
  double a[3], G[9], work[kPullNumbers];
  acceleration(g, at, body + 1, a, G);
  const double length = length_of(a, G), moves = largest(rate + 1, 3);
  const auto there = [&](double s, double* to) {
    double moved[kBodyNumbers];
    for (int i = 0; i < kBodyNumbers; ++i) moved[i] = body[i] + s * rate[i];
    pull(g, at, moved, to);
  };
  // In m and S it is linear: any step will do, but none without end, as where the flow of a valve that was shut has faded to 1e-300 kg/s.
  const double h = moves > 0.0 && std::isfinite(length) ? std::min(kStep * length / moves, kLongest) : 1.0;
  derivative(there, h, kPullNumbers, out, work);
}

}  // namespace detail
}  // namespace cardan::soa
