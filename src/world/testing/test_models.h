// For tests: files of a box in the formats of models, centred at the origin. Its size is along x, y and z in the world,
// where z is up; in the files y is up.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "scene/axes.h"

namespace tessera {

// The corners of a box in a file; corner i is at the upper end along axis a if bit a of i is set.
inline std::array<Vec3f, 8> testBoxCorners(const Vec3d& size) {
  std::array<Vec3f, 8> corners;
  for (size_t i = 0; i < 8; ++i) {
    const Vec3d up((i & 1) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? 0.5 : -0.5, (i & 4) != 0 ? 0.5 : -0.5);
    corners[i] = up.cwiseProduct(Vec3d(size.x(), size.z(), size.y())).cast<float>();
  }
  return corners;
}

// Corners of its triangles, anticlockwise as seen from outside.
inline constexpr std::array<uint16_t, 36> kTestBoxTriangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                                               2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

inline std::string testBoxBuffer(const Vec3d& size) {
  std::string buffer(8 * 12 + 36 * 2, '\0');
  const std::array<Vec3f, 8> corners = testBoxCorners(size);
  for (size_t i = 0; i < 8; ++i) std::memcpy(buffer.data() + 12 * i, corners[i].data(), 12);
  std::memcpy(buffer.data() + 96, kTestBoxTriangles.data(), 72);
  return buffer;
}

// `colour`: linear red, green, blue, opacity. `buffer`: fields of its buffer. `more`: fields of its material.
inline std::string testGltfJson(const Vec3d& size, const std::string& colour, const std::string& buffer,
                                const std::string& more) {
  const Vec3d half = size / 2;
  return fmt::format(
      R"({{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
 "nodes": [{{"children": [1], "scale": [2, 2, 2]}}, {{"mesh": 0, "scale": [0.5, 0.5, 0.5]}}],
 "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}}]}}],
 "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [{}], "metallicFactor": 0}}{}}}],
 "accessors": [
  {{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [{},{},{}], "max": [{},{},{}]}},
  {{"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}}],
 "bufferViews": [{{"buffer": 0, "byteLength": 96}}, {{"buffer": 0, "byteOffset": 96, "byteLength": 72}}],
 "buffers": [{{"byteLength": 168{}}}]}})",
      colour, more, -half.x(), -half.z(), -half.y(), half.x(), half.z(), half.y(), buffer);
}

inline std::string testBase64(const std::string& bytes) {
  const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return text;
}

inline std::string testGltf(const Vec3d& size, const std::string& colour, const std::string& more = "") {
  const std::string data = testBase64(testBoxBuffer(size));
  return testGltfJson(size, colour, R"(, "uri": "data:application/octet-stream;base64,)" + data + "\"", more);
}

inline std::string testGlb(const Vec3d& size, const std::string& colour, const std::string& more = "") {
  std::string json = testGltfJson(size, colour, "", more);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::string buffer = testBoxBuffer(size);
  std::string file;
  const auto add = [&](uint32_t word) { file.append(reinterpret_cast<const char*>(&word), 4); };
  add(0x46546c67);
  add(2);
  add(static_cast<uint32_t>(28 + json.size() + buffer.size()));
  add(static_cast<uint32_t>(json.size()));
  add(0x4e4f534a);
  file += json;
  add(static_cast<uint32_t>(buffer.size()));
  add(0x004e4942);
  return file + buffer;
}

// `library`: the file of its material "paint".
inline std::string testObj(const Vec3d& size, const std::string& library) {
  std::string text = "mtllib " + library + "\nusemtl paint\nvt 0 0\nvt 1 0\nvt 0 1\n";
  for (const Vec3f& corner : testBoxCorners(size)) {
    text += fmt::format("v {} {} {}\n", corner.x(), corner.y(), corner.z());
  }
  for (size_t i = 0; i < 36; i += 3) {
    text += fmt::format("f {}/1 {}/2 {}/3\n", kTestBoxTriangles[i] + 1, kTestBoxTriangles[i + 1] + 1,
                        kTestBoxTriangles[i + 2] + 1);
  }
  return text;
}

// The text form of FBX.
inline std::string testFbx(const Vec3d& size) {
  std::string corners, triangles;
  for (const Vec3f& corner : testBoxCorners(size)) {
    corners += fmt::format("{}{},{},{}", corners.empty() ? "" : ",", corner.x(), corner.y(), corner.z());
  }
  for (size_t i = 0; i < 36; i += 3) {  // the last corner of a polygon is negative
    triangles += fmt::format("{}{},{},{}", triangles.empty() ? "" : ",", kTestBoxTriangles[i], kTestBoxTriangles[i + 1],
                             -kTestBoxTriangles[i + 2] - 1);
  }
  return fmt::format(R"(; FBX 7.3.0 project file
FBXHeaderExtension:  {{
	FBXHeaderVersion: 1003
	FBXVersion: 7300
}}
GlobalSettings:  {{
	Version: 1000
	Properties70:  {{
		P: "UpAxis", "int", "Integer", "",1
		P: "UpAxisSign", "int", "Integer", "",1
		P: "FrontAxis", "int", "Integer", "",2
		P: "FrontAxisSign", "int", "Integer", "",1
		P: "CoordAxis", "int", "Integer", "",0
		P: "CoordAxisSign", "int", "Integer", "",1
		P: "UnitScaleFactor", "double", "Number", "",1
	}}
}}
Objects:  {{
	Geometry: 1000, "Geometry::", "Mesh" {{
		Vertices: *24 {{
			a: {}
		}}
		PolygonVertexIndex: *36 {{
			a: {}
		}}
		GeometryVersion: 124
	}}
	Model: 2000, "Model::box", "Mesh" {{
		Version: 232
		Properties70:  {{
		}}
	}}
	Material: 3000, "Material::paint", "" {{
		Version: 102
		ShadingModel: "phong"
		Properties70:  {{
			P: "DiffuseColor", "Color", "", "A",0,0,1
		}}
	}}
}}
Connections:  {{
	C: "OO",2000,0
	C: "OO",1000,2000
	C: "OO",3000,2000
}}
)",
                     corners, triangles);
}

}  // namespace tessera
