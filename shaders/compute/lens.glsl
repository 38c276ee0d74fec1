// Unprojection of pixels to directions: src/scene/lens.h in GLSL, with the same numbers for the camera models.
// Defines: RayCamera, cameraAt(), lensUnproject().
#include "../lib/trigonometry.glsl"

const uint kCameraWords = 29;
const int kSimplePinhole = 0, kPinhole = 1, kSimpleRadial = 2, kRadial = 3, kOpenCv = 4, kOpenCvFisheye = 5;
const int kFullOpenCv = 6, kFov = 7, kSimpleRadialFisheye = 8, kRadialFisheye = 9, kThinPrismFisheye = 10;
const int kRadTanThinPrismFisheye = 11, kSimpleDivision = 12, kDivision = 13, kEucm = 16;
const float kEpsilon = 1.1920929e-7;

struct RayCamera {
  int lens;
  float parameters[16];
  mat3 sceneFromCamera;
  vec3 centre;
};

RayCamera cameraAt(UintPointer cameras, uint index) {
  const uint first = kCameraWords * index;
  RayCamera camera;
  camera.lens = int(cameras.values[first]);
  for (uint i = 0; i < 16; ++i) camera.parameters[i] = uintBitsToFloat(cameras.values[first + 1 + i]);
  for (uint row = 0; row < 3; ++row) {
    for (uint column = 0; column < 3; ++column) {
      camera.sceneFromCamera[column][row] = uintBitsToFloat(cameras.values[first + 17 + 3 * row + column]);
    }
    camera.centre[row] = uintBitsToFloat(cameras.values[first + 26 + row]);
  }
  return camera;
}

// The distortion terms of all models; each model uses some of them.
struct LensTerms {
  vec2 focal, principal;
  bool fisheye;
  bool plain;        // there is no distortion in the image plane
  bool radialFirst;  // tangential and prism terms act on the radially distorted point
  float k[6];        // radial: numerator 1 + Σ k[i] r^(2i+2)
  float d[3];        // denominator 1 + Σ d[i] r^(2i+2)
  vec2 tangential;   // p1, p2 as OpenCV names them
  vec2 prismX, prismY;  // factors of r² and r⁴
};

LensTerms unpackLensTerms(int lens, float p[16]) {
  LensTerms t;
  const bool oneFocal = lens == kSimplePinhole || lens == kSimpleRadial || lens == kRadial ||
                        lens == kSimpleRadialFisheye || lens == kRadialFisheye || lens == kSimpleDivision;
  t.focal = vec2(p[0], oneFocal ? p[0] : p[1]);
  t.principal = oneFocal ? vec2(p[1], p[2]) : vec2(p[2], p[3]);
  t.fisheye = lens == kOpenCvFisheye || lens == kSimpleRadialFisheye || lens == kRadialFisheye ||
              lens == kThinPrismFisheye || lens == kRadTanThinPrismFisheye;
  t.plain = lens == kSimplePinhole || lens == kPinhole || lens == kSimpleDivision || lens == kDivision || lens == kEucm;
  t.radialFirst = lens == kRadTanThinPrismFisheye;
  for (int i = 0; i < 6; ++i) t.k[i] = 0;
  for (int i = 0; i < 3; ++i) t.d[i] = 0;
  t.tangential = t.prismX = t.prismY = vec2(0);
  const int first = oneFocal ? 3 : 4;  // index of the first distortion parameter
  if (lens == kRadTanThinPrismFisheye) {
    for (int i = 0; i < 6; ++i) t.k[i] = p[first + i];
    t.tangential = vec2(p[first + 7], p[first + 6]);
    t.prismX = vec2(p[first + 8], p[first + 9]);
    t.prismY = vec2(p[first + 10], p[first + 11]);
    return t;
  }
  if (!t.plain && lens != kFov) t.k[0] = p[first];
  if (lens == kRadial || lens == kRadialFisheye) t.k[1] = p[first + 1];
  if (lens == kOpenCvFisheye) {
    for (int i = 1; i < 4; ++i) t.k[i] = p[first + i];
  }
  if (lens == kOpenCv || lens == kThinPrismFisheye || lens == kFullOpenCv) {
    t.k[1] = p[first + 1];
    t.tangential = vec2(p[first + 2], p[first + 3]);
  }
  if (lens == kThinPrismFisheye) {
    t.k[2] = p[first + 4];
    t.k[3] = p[first + 5];
    t.prismX.x = p[first + 6];
    t.prismY.x = p[first + 7];
  }
  if (lens == kFullOpenCv) {
    t.k[2] = p[first + 4];
    for (int i = 0; i < 3; ++i) t.d[i] = p[first + 5 + i];
  }
  return t;
}

struct Distorted {
  vec2 place;
  vec2 alongA, alongB;  // the Jacobian's columns
};

float jacobianDeterminant(Distorted at) { return at.alongA.x * at.alongB.y - at.alongB.x * at.alongA.y; }

// The distortion of the polynomial models in the image plane, with its Jacobian.
Distorted distort(LensTerms t, vec2 from) {
  const float r2 = dot(from, from);
  float n = t.k[5], nSlope = 0;  // numerator - 1 = r2·n by Horner; slopes are with respect to r2
  for (int i = 4; i >= 0; --i) {
    nSlope = nSlope * r2 + n;
    n = n * r2 + t.k[i];
  }
  nSlope = nSlope * r2 + n;
  n = n * r2 + 1;
  float m = t.d[2], mSlope = 0;
  for (int i = 1; i >= 0; --i) {
    mSlope = mSlope * r2 + m;
    m = m * r2 + t.d[i];
  }
  mSlope = mSlope * r2 + m;
  m = m * r2 + 1;
  const float radial = n / m, slope = 2 * (nSlope * m - n * mSlope) / (m * m);
  Distorted result;
  result.place = from * radial;
  result.alongA = vec2(radial, 0) + from * (from.x * slope);
  result.alongB = vec2(0, radial) + from * (from.y * slope);

  const vec2 at = t.radialFirst ? result.place : from;
  const float q2 = dot(at, at);
  const float p1 = t.tangential.x, p2 = t.tangential.y;
  const float prismX = 2 * (t.prismX.x + 2 * t.prismX.y * q2), prismY = 2 * (t.prismY.x + 2 * t.prismY.y * q2);
  const vec2 ofX = vec2(2 * p1 * at.y + 6 * p2 * at.x + at.x * prismX, 2 * p2 * at.y + 2 * p1 * at.x + at.x * prismY);
  const vec2 ofY = vec2(2 * p1 * at.x + 2 * p2 * at.y + at.y * prismX, 2 * p2 * at.x + 6 * p1 * at.y + at.y * prismY);
  result.place += vec2(2 * p1 * at.x * at.y + p2 * (q2 + 2 * at.x * at.x) + q2 * (t.prismX.x + t.prismX.y * q2),
                     2 * p2 * at.x * at.y + p1 * (q2 + 2 * at.y * at.y) + q2 * (t.prismY.x + t.prismY.y * q2));
  if (t.radialFirst) {
    result.alongA += ofX * result.alongA.x + ofY * result.alongA.y;
    result.alongB += ofX * result.alongB.x + ofY * result.alongB.y;
  } else {
    result.alongA += ofX;
    result.alongB += ofY;
  }
  return result;
}

// Whether the distortion does not fold between the centre and a point, tested at samples.
bool isBeforeFold(LensTerms t, vec2 place) {
  for (int i = 1; i <= 16; ++i) {
    if (!(jacobianDeterminant(distort(t, place * (float(i) / 16))) > 0)) return false;
  }
  return true;
}

// Finds the point before the fold that distorts to `target`, by Newton's method with step halving.
bool undistort(LensTerms t, vec2 target, out vec2 undistorted) {
  undistorted = target;
  Distorted at = distort(t, undistorted);
  for (int i = 0; i < 24 && !(jacobianDeterminant(at) > 0); ++i) {  // the iteration does not converge from beyond the fold
    undistorted *= 0.75;
    at = distort(t, undistorted);
  }
  const float scale = 1 + length(target);
  float error = length(at.place - target);
  for (int iteration = 0; iteration < 40 && error > 4 * kEpsilon * scale; ++iteration) {
    const float determinant = jacobianDeterminant(at);
    if (!(determinant > 0)) return false;
    const vec2 miss = target - at.place;
    vec2 change = vec2(at.alongB.y * miss.x - at.alongB.x * miss.y, at.alongA.x * miss.y - at.alongA.y * miss.x);
    change /= determinant;
    bool better = false;
    for (int halving = 0; halving < 16 && !better; ++halving, change /= 2) {
      const Distorted next = distort(t, undistorted + change);
      const float nextError = length(next.place - target);
      if (!(jacobianDeterminant(next) > 0 && nextError < error)) continue;
      undistorted += change;
      at = next;
      error = nextError;
      better = true;
    }
    if (!better) break;
  }
  return error < 64 * kEpsilon * scale && isBeforeFold(t, undistorted);
}

// The FOV model has a closed-form inverse, a function of the radius.
bool undistortFov(float omega, inout vec2 place) {
  const float angle = length(place) * omega;
  if (!(abs(angle) < 1.5707)) return false;
  const float slope = abs(omega) < 1e-6 ? 1 : 2 * tangent(omega / 2) / omega;  // slope at the centre
  place *= (abs(angle) < 1e-3 ? 1 + angle * angle / 3 : tangent(angle) / angle) / slope;
  return true;
}

bool unifiedDepth(float alpha, float beta, vec2 place, out float z) {
  z = 0;
  if (!(alpha >= 0 && alpha <= 1 && beta > 0)) return false;
  const float s = beta * dot(place, place), square = 1 - (2 * alpha - 1) * s;
  if (!(square > 0)) return false;
  z = (1 - alpha * alpha * s) / (alpha * sqrt(square) + 1 - alpha);
  return true;
}

// Computes the unit direction of the ray through a pixel in camera axes. Returns false if the lens has no inverse
// there.
bool lensUnproject(int lens, float parameters[16], vec2 pixel, out vec3 direction) {
  const LensTerms t = unpackLensTerms(lens, parameters);
  direction = vec3(0);
  vec2 place = (pixel - t.principal) / t.focal;
  if (any(isnan(place)) || any(isinf(place))) return false;
  if (lens == kFov) {
    if (!undistortFov(parameters[4], place)) return false;
  } else if (!t.plain) {
    vec2 undistorted;
    if (!undistort(t, place, undistorted)) return false;
    place = undistorted;
  }
  float z = 1;
  if (lens == kSimpleDivision || lens == kDivision) {
    const float bend = parameters[lens == kSimpleDivision ? 3 : 4] * dot(place, place);
    if (!(bend < 1)) return false;
    z = 1 + bend;
  } else if (lens == kEucm) {
    if (!unifiedDepth(parameters[4], parameters[5], place, z)) return false;
  } else if (t.fisheye) {
    const float theta = length(place);
    if (!(theta <= 3.14159265)) return false;
    place *= theta < 1e-3 ? 1 - theta * theta / 6 : sine(theta) / theta;
    z = cosine(theta);
  }
  const float all = length(vec3(place, z));
  direction = vec3(place, z) / all;
  return !isnan(all) && !isinf(all);
}
