// Projection and unprojection of every lens model, as templates over the scalar type, so that cameras (double) and
// ray-generating kernels (float) share one implementation. No allocation, no exceptions, no dependency but <cmath>.
//
// A lens is a map of a plane onto itself followed by focal lengths and principal point. Perspective lenses distort
// (x/z, y/z); fisheye lenses distort θ·(cos φ, sin φ), θ being the angle off the optical axis, which may exceed 90°.
// Such a map is valid only up to where it first folds (its Jacobian determinant, 1 at the centre, reaches zero):
// no point beyond the fold is ever returned. The division model and the unified model map between plane and directions
// in closed form, both ways, and may exceed 90° too.
//
// Source: COLMAP's camera models (src/colmap/sensor/models.h). Division: Fitzgibbon, "Simultaneous linear estimation of
// multiple view geometry and lens distortion", 2001. EUCM: Khomutenko et al., "An Enhanced Unified Camera Model", 2016.
#pragma once

#include <cmath>
#include <limits>

namespace tessera {

// Numbered as in COLMAP's binary files.
enum class LensModel : int {
  simplePinhole = 0,            // f, cx, cy
  pinhole = 1,                  // fx, fy, cx, cy
  simpleRadial = 2,             // f, cx, cy, k
  radial = 3,                   // f, cx, cy, k1, k2
  openCv = 4,                   // fx, fy, cx, cy, k1, k2, p1, p2
  openCvFisheye = 5,            // fx, fy, cx, cy, k1, k2, k3, k4
  fullOpenCv = 6,               // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  fov = 7,                      // fx, fy, cx, cy, omega
  simpleRadialFisheye = 8,      // f, cx, cy, k
  radialFisheye = 9,            // f, cx, cy, k1, k2
  thinPrismFisheye = 10,        // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  radTanThinPrismFisheye = 11,  // fx, fy, cx, cy, k0..k5, p0, p1, s0..s3
  simpleDivision = 12,          // f, cx, cy, k
  division = 13,                // fx, fy, cx, cy, k
  eucm = 16                     // fx, fy, cx, cy, alpha, beta
};
inline constexpr LensModel kLensModels[] = {LensModel::simplePinhole,
                                            LensModel::pinhole,
                                            LensModel::simpleRadial,
                                            LensModel::radial,
                                            LensModel::openCv,
                                            LensModel::openCvFisheye,
                                            LensModel::fullOpenCv,
                                            LensModel::fov,
                                            LensModel::simpleRadialFisheye,
                                            LensModel::radialFisheye,
                                            LensModel::thinPrismFisheye,
                                            LensModel::radTanThinPrismFisheye,
                                            LensModel::simpleDivision,
                                            LensModel::division,
                                            LensModel::eucm};

namespace lens_internal {

// The terms of all models; each model sets those that it uses.
template <class T>
struct Terms {
  T fx, fy, cx, cy;
  bool fisheye = false;
  bool plain = false;        // no distortion in the plane
  bool radialFirst = false;  // tangential and prism terms act on the radially distorted point
  bool isFov = false, isDivision = false, isUnified = false;
  T k[6] = {};                           // radial: numerator 1 + Σ k[i] r^(2i+2)
  T d[3] = {};                           // denominator 1 + Σ d[i] r^(2i+2)
  T p1 = 0, p2 = 0;                      // tangential, as OpenCV names them
  T sx1 = 0, sx2 = 0, sy1 = 0, sy2 = 0;  // thin prism: factors of r² and r⁴
  T omega = 0;                           // FOV
  T alpha = 0, beta = 1;                 // EUCM
};

template <class T>
Terms<T> unpackLensTerms(LensModel model, const T* p) {
  Terms<T> t{};
  const bool oneFocal = model == LensModel::simplePinhole || model == LensModel::simpleRadial ||
                        model == LensModel::radial || model == LensModel::simpleRadialFisheye ||
                        model == LensModel::radialFisheye || model == LensModel::simpleDivision;
  t.fx = p[0];
  t.fy = oneFocal ? p[0] : p[1];
  t.cx = p[oneFocal ? 1 : 2];
  t.cy = p[oneFocal ? 2 : 3];
  const T* q = p + (oneFocal ? 3 : 4);
  switch (model) {
    case LensModel::simplePinhole:
    case LensModel::pinhole:
      t.plain = true;
      break;
    case LensModel::simpleRadialFisheye:
      t.fisheye = true;
      [[fallthrough]];
    case LensModel::simpleRadial:
      t.k[0] = q[0];
      break;
    case LensModel::radialFisheye:
      t.fisheye = true;
      [[fallthrough]];
    case LensModel::radial:
      t.k[0] = q[0];
      t.k[1] = q[1];
      break;
    case LensModel::openCvFisheye:
      t.fisheye = true;
      for (int i = 0; i < 4; ++i) t.k[i] = q[i];
      break;
    case LensModel::thinPrismFisheye:
      t.fisheye = true;
      t.k[2] = q[4];
      t.k[3] = q[5];
      t.sx1 = q[6];
      t.sy1 = q[7];
      [[fallthrough]];
    case LensModel::openCv:
      t.k[0] = q[0];
      t.k[1] = q[1];
      t.p1 = q[2];
      t.p2 = q[3];
      break;
    case LensModel::fullOpenCv:
      t.k[0] = q[0];
      t.k[1] = q[1];
      t.p1 = q[2];
      t.p2 = q[3];
      t.k[2] = q[4];
      for (int i = 0; i < 3; ++i) t.d[i] = q[5 + i];
      break;
    case LensModel::fov:
      t.isFov = true;
      t.omega = q[0];
      break;
    case LensModel::radTanThinPrismFisheye:
      t.fisheye = t.radialFirst = true;
      for (int i = 0; i < 6; ++i) t.k[i] = q[i];
      t.p2 = q[6];
      t.p1 = q[7];
      t.sx1 = q[8];
      t.sx2 = q[9];
      t.sy1 = q[10];
      t.sy2 = q[11];
      break;
    case LensModel::simpleDivision:
    case LensModel::division:
      t.plain = t.isDivision = true;
      t.k[0] = q[0];
      break;
    case LensModel::eucm:
      t.plain = t.isUnified = true;
      t.alpha = q[0];
      t.beta = q[1];
      break;
  }
  return t;
}

template <class T>
struct Distorted {
  T x, y;
  T xa, xb, ya, yb;  // Jacobian: ∂x/∂a, ∂x/∂b, ∂y/∂a, ∂y/∂b
  T determinant() const { return xa * yb - xb * ya; }
};

// Evaluates the distortion of the polynomial models at (a, b), with its Jacobian.
template <class T>
Distorted<T> distort(const Terms<T>& t, T a, T b) {
  const T r2 = a * a + b * b;
  T n = t.k[5], nSlope = 0;  // numerator - 1 = r2·n by Horner; slopes are with respect to r2
  for (int i = 4; i >= 0; --i) {
    nSlope = nSlope * r2 + n;
    n = n * r2 + t.k[i];
  }
  nSlope = nSlope * r2 + n;
  n = n * r2 + 1;
  T m = t.d[2], mSlope = 0;
  for (int i = 1; i >= 0; --i) {
    mSlope = mSlope * r2 + m;
    m = m * r2 + t.d[i];
  }
  mSlope = mSlope * r2 + m;
  m = m * r2 + 1;
  const T radial = n / m, slope = 2 * (nSlope * m - n * mSlope) / (m * m);

  Distorted<T> out{a * radial,    b * radial,    radial + a * a * slope,
                   a * b * slope, a * b * slope, radial + b * b * slope};
  const T s = t.radialFirst ? out.x : a, v = t.radialFirst ? out.y : b;
  const T q2 = s * s + v * v;
  const T prismX = 2 * (t.sx1 + 2 * t.sx2 * q2), prismY = 2 * (t.sy1 + 2 * t.sy2 * q2);
  const T xs = 2 * t.p1 * v + 6 * t.p2 * s + s * prismX, xv = 2 * t.p1 * s + 2 * t.p2 * v + v * prismX;
  const T ys = 2 * t.p2 * v + 2 * t.p1 * s + s * prismY, yv = 2 * t.p2 * s + 6 * t.p1 * v + v * prismY;
  out.x += 2 * t.p1 * s * v + t.p2 * (q2 + 2 * s * s) + q2 * (t.sx1 + t.sx2 * q2);
  out.y += 2 * t.p2 * s * v + t.p1 * (q2 + 2 * v * v) + q2 * (t.sy1 + t.sy2 * q2);
  if (t.radialFirst) {
    const Distorted<T> r = out;
    out.xa = r.xa + xs * r.xa + xv * r.ya;
    out.xb = r.xb + xs * r.xb + xv * r.yb;
    out.ya = r.ya + ys * r.xa + yv * r.ya;
    out.yb = r.yb + ys * r.xb + yv * r.yb;
  } else {
    out.xa += xs;
    out.xb += xv;
    out.ya += ys;
    out.yb += yv;
  }
  return out;
}

// Returns whether the Jacobian determinant stays positive on the way from the centre to (a, b). It is sampled: a fold
// narrower than a sixteenth of the way is missed.
template <class T>
bool isBeforeFold(const Terms<T>& t, T a, T b) {
  constexpr int kSamples = 16;
  for (int i = 1; i <= kSamples; ++i) {
    const T along = T(i) / kSamples;
    if (!(distort(t, a * along, b * along).determinant() > 0)) return false;
  }
  return true;
}

// Returns tan(ω/2)·2/ω, the slope of the FOV model at the centre; 1 for ω = 0.
template <class T>
T fovSlope(T omega) {
  return std::abs(omega) < T(1e-6) ? T(1) : 2 * std::tan(omega / 2) / omega;
}

// Finds the point (a, b) before the fold that distorts to (x, y), by Newton's method with step halving. Returns false
// if it does not converge.
template <class T>
bool undistort(const Terms<T>& t, T x, T y, T& a, T& b) {
  constexpr T kEpsilon = std::numeric_limits<T>::epsilon();
  a = x;
  b = y;
  Distorted<T> at = distort(t, a, b);
  for (int i = 0; i < 24 && !(at.determinant() > 0); ++i) {  // from beyond the fold it would not converge
    a *= T(0.75);
    b *= T(0.75);
    at = distort(t, a, b);
  }
  const T scale = 1 + std::sqrt(x * x + y * y);
  T error = std::hypot(at.x - x, at.y - y);
  for (int iteration = 0; iteration < 40 && error > 4 * kEpsilon * scale; ++iteration) {
    const T determinant = at.determinant();
    if (!(determinant > 0)) return false;
    T stepA = (at.yb * (x - at.x) - at.xb * (y - at.y)) / determinant;
    T stepB = (at.xa * (y - at.y) - at.ya * (x - at.x)) / determinant;
    bool better = false;
    for (int halving = 0; halving < 16 && !better; ++halving, stepA /= 2, stepB /= 2) {
      const Distorted<T> next = distort(t, a + stepA, b + stepB);
      const T nextError = std::hypot(next.x - x, next.y - y);
      if (next.determinant() > 0 && nextError < error) {
        a += stepA;
        b += stepB;
        at = next;
        error = nextError;
        better = true;
      }
    }
    if (!better) break;
  }
  return error < 64 * kEpsilon * scale && isBeforeFold(t, a, b);
}

// Division model: the direction through (a, b) is (a, b, 1 + k r²). Its angle off the axis grows with r; for k > 0 only
// until r² = 1/k, where it folds.
template <class T>
bool divisionUnproject(T k, T a, T b, T& z) {
  const T kr2 = k * (a * a + b * b);
  z = 1 + kr2;
  return kr2 < 1;
}

// Division model: multiplies (a, b) of a unit direction by r / ρ, where r is the smaller root of k ρ r² - z r + ρ = 0.
template <class T>
bool divisionProject(T k, T z, T& a, T& b) {
  const T rho2 = a * a + b * b;
  const T square = z * z - 4 * k * rho2;
  if (!(square > 0)) return false;
  const T root = std::sqrt(square);
  // Behind the camera z + root suffers from cancellation, so the other form is used. No finite positive factor exists
  // on the axis behind the camera, nor anywhere behind a lens with k ≥ 0.
  const T factor = z > 0 ? 2 / (z + root) : (z - root) / (2 * k * rho2);
  if (!(factor > 0)) return false;
  a *= factor;
  b *= factor;
  return true;
}

template <class T>
bool isUnifiedLens(T alpha, T beta) {
  return alpha >= 0 && alpha <= 1 && beta > 0;
}

// Unified model: the direction through (a, b) is (a, b, z) with z = (1 - α²βr²) / (α √(1 - (2α - 1)βr²) + 1 - α).
template <class T>
bool unifiedUnproject(T alpha, T beta, T a, T b, T& z) {
  if (!isUnifiedLens(alpha, beta)) return false;
  const T s = beta * (a * a + b * b);
  const T square = 1 - (2 * alpha - 1) * s;
  if (!(square > 0)) return false;
  z = (1 - alpha * alpha * s) / (alpha * std::sqrt(square) + 1 - alpha);
  return true;
}

// Unified model: divides (a, b) of a unit direction by α ρ + (1 - α) z, with ρ² = β (a² + b²) + z².
template <class T>
bool unifiedProject(T alpha, T beta, T z, T& a, T& b) {
  if (!isUnifiedLens(alpha, beta)) return false;
  const T rho = std::sqrt(beta * (a * a + b * b) + z * z);
  const T divisor = alpha * rho + (1 - alpha) * z;
  // The second condition is the sign of ∂r/∂θ: where it is negative the map has folded back.
  if (!(divisor > 0) || !(alpha * z + (1 - alpha) * rho > 0)) return false;
  a /= divisor;
  b /= divisor;
  return true;
}

}  // namespace lens_internal

// Computes the unit direction in camera axes (right, down, forward) of the ray through pixel position (x, y). Returns
// false where the lens has no inverse. `parameters` are in COLMAP's order.
template <class T>
bool lensUnproject(LensModel model, const T* parameters, T x, T y, T directionOut[3]) {
  using namespace lens_internal;
  const Terms<T> t = unpackLensTerms(model, parameters);
  T a = (x - t.cx) / t.fx, b = (y - t.cy) / t.fy;
  if (!std::isfinite(a) || !std::isfinite(b)) return false;
  if (t.isFov) {
    const T r = std::sqrt(a * a + b * b);
    if (!(std::abs(r * t.omega) < T(1.5707))) return false;
    const T angle = r * t.omega;
    const T factor = (std::abs(angle) < T(1e-3) ? 1 + angle * angle / 3 : std::tan(angle) / angle) / fovSlope(t.omega);
    a *= factor;
    b *= factor;
  } else if (!t.plain) {
    if (!undistort(t, T(a), T(b), a, b)) return false;
  }
  T z = 1;
  if (t.isDivision) {
    if (!divisionUnproject(t.k[0], a, b, z)) return false;
  } else if (t.isUnified) {
    if (!unifiedUnproject(t.alpha, t.beta, a, b, z)) return false;
  } else if (t.fisheye) {
    const T theta = std::sqrt(a * a + b * b);
    if (!(theta <= T(3.14159265358979))) return false;
    const T factor = theta < T(1e-3) ? 1 - theta * theta / 6 : std::sin(theta) / theta;
    a *= factor;
    b *= factor;
    z = std::cos(theta);
  }
  const T length = std::sqrt(a * a + b * b + z * z);
  directionOut[0] = a / length;
  directionOut[1] = b / length;
  directionOut[2] = z / length;
  return std::isfinite(length);
}

// Computes the pixel position of a point in camera axes. Returns false if the lens cannot see it.
template <class T>
bool lensProject(LensModel model, const T* parameters, const T xInCamera[3], T pixelOut[2]) {
  using namespace lens_internal;
  const Terms<T> t = unpackLensTerms(model, parameters);
  T a = xInCamera[0], b = xInCamera[1];
  T z = xInCamera[2];
  if (t.isDivision || t.isUnified) {
    const T length = std::hypot(a, b, z);
    a /= length;
    b /= length;
    z /= length;
    if (!(t.isDivision ? divisionProject(t.k[0], z, a, b) : unifiedProject(t.alpha, t.beta, z, a, b))) return false;
  } else if (t.fisheye) {
    const T rho = std::hypot(a, b);
    if (rho == 0) {
      if (!(z > 0)) return false;
    } else {
      const T factor = std::atan2(rho, z) / rho;
      a *= factor;
      b *= factor;
    }
  } else {
    if (!(z > 0)) return false;
    a /= z;
    b /= z;
  }
  if (t.isFov) {
    if (!(std::abs(t.omega) < T(3.1415))) return false;
    const T slope = fovSlope(t.omega);
    const T reach = std::sqrt(a * a + b * b) * slope * t.omega;
    const T factor = slope * (std::abs(reach) < T(1e-3) ? 1 - reach * reach / 3 : std::atan(reach) / reach);
    a *= factor;
    b *= factor;
  } else if (!t.plain) {
    if (!isBeforeFold(t, a, b)) return false;
    const Distorted<T> d = distort(t, a, b);
    a = d.x;
    b = d.y;
  }
  pixelOut[0] = t.fx * a + t.cx;
  pixelOut[1] = t.fy * b + t.cy;
  return std::isfinite(pixelOut[0]) && std::isfinite(pixelOut[1]);
}

}  // namespace tessera
