// Writes a few small valid inputs for every fuzzer to DIR/<fuzzer>/, from which libFuzzer derives others.
#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "base/file.h"
#include "base/image_io.h"
#include "base/safetensors.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/testing/random_content.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "representations/volume/content/volume_payload.h"
#include "representations/volume/testing/random_content.h"
#include "scene/ply.h"
#include "tiles/glb.h"
#include "tiles/testing/test_tileset.h"
#include "tiles/tileset_json.h"
#include "world/testing/test_models.h"

using namespace tessera;

namespace {

template <class T>
std::string packed(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

std::string sized(const std::string& file) {
  return packed(static_cast<uint16_t>(file.size())) + file;
}

std::string doubles(std::initializer_list<double> values) {
  std::string out;
  for (double value : values) out += packed(value);
  return out;
}

std::string colmapBinary() {
  const std::string cameras = packed(uint64_t{1}) + packed(1u) + packed(4) + packed(uint64_t{64}) +
                              packed(uint64_t{48}) + doubles({50, 51, 32, 24, .1, -.05, .001, .002});
  const std::string images = packed(uint64_t{1}) + packed(1u) + doubles({1, 0, 0, 0, 0, 0, 2}) + packed(1u) + "a.jpg" +
                             std::string(1, '\0') + packed(uint64_t{1}) + doubles({30, 20}) + packed(uint64_t{5});
  const std::string points = packed(uint64_t{1}) + packed(uint64_t{5}) + doubles({.1, .2, .3}) + "rgb" + doubles({.5}) +
                             packed(uint64_t{1}) + packed(1u) + packed(0u);
  return sized(cameras) + sized(images) + points;
}

ImageU8 picture(int channels) {
  ImageU8 image(9, 7, channels);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(i * 37);
  return image;
}

// A model with a map of every kind, sparse and normalised accessors, and a strip.
std::string texturedGltf() {
  const Bytes png = encodePng(picture(3));
  const std::string image = testBase64({reinterpret_cast<const char*>(png.data()), png.size()});
  const std::string texture = R"({"index":0,"texCoord":0,"extensions":{"KHR_texture_transform":{"offset":[0.5,0],)"
                              R"("scale":[2,1],"rotation":0.5}}})";
  return R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0,"rotation":[0,0,0,1],"translation":[1,2,3]}],)"
         R"("meshes":[{"primitives":[{"mode":5,"material":0,"indices":3,"attributes":)"
         R"({"POSITION":0,"NORMAL":1,"TEXCOORD_0":2,"COLOR_0":1}}]}],"accessors":[)"
         R"({"componentType":5126,"count":4,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":0,)"
         R"("componentType":5121},"values":{"bufferView":0}}},)"
         R"({"bufferView":0,"componentType":5120,"normalized":true,"count":4,"type":"VEC3"},)"
         R"({"bufferView":0,"componentType":5123,"normalized":true,"count":4,"type":"VEC2"},)"
         R"({"bufferView":0,"byteOffset":4,"componentType":5121,"count":4,"type":"SCALAR"}],)"
         R"("bufferViews":[{"buffer":0,"byteLength":24}],"buffers":[{"byteLength":24,"uri":"data:;base64,)" +
         testBase64(std::string("\1\2\3\4\0\1\2\3", 8) + std::string(16, '\1')) +
         R"("}],"images":[{"uri":"data:image/png;base64,)" + image +
         R"("}],"textures":[{"source":0}],"materials":[{"pbrMetallicRoughness":{"baseColorTexture":)" + texture +
         R"(,"metallicRoughnessTexture":)" + texture + R"(},"emissiveTexture":)" + texture +
         R"(,"emissiveFactor":[1,1,1],"alphaMode":"MASK","extensions":{"KHR_materials_transmission":)"
         R"({"transmissionFactor":0.5},"KHR_materials_emissive_strength":{"emissiveStrength":2}}}]})";
}

// A database with the tables of COLMAP that are read, two photos and a pair.
std::string colmapDatabase() {
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  sqlite3_exec(database,
               "PRAGMA page_size=512; CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER);"
               "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER);"
               "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER);"
               "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY, rows INTEGER);"
               "INSERT INTO images VALUES(1, 'p0', 1), (2, 'p1', 1); INSERT INTO keypoints VALUES(1, 900), (2, 0);"
               "INSERT INTO two_view_geometries VALUES(2147483649, 77);",
               nullptr, nullptr, nullptr);
  sqlite3_int64 size = 0;
  unsigned char* bytes = sqlite3_serialize(database, "main", &size, 0);
  const std::string file(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
  sqlite3_free(bytes);
  sqlite3_close(database);
  return file;
}

// An EXIF block with a latitude, from which the fuzzer finds the other tags.
std::string exif() {
  std::string out("Exif\0\0II*\0\x08\0\0\0\x01\0\x25\x88\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0", 32);
  out += std::string("\x02\0\x01\0\x02\0\x02\0\0\0N\0\0\0\x02\0\x05\0\x03\0\0\0\x38\0\0\0\0\0\0\0", 30);
  for (uint32_t value : {50u, 1u, 30u, 1u, 0u, 1u}) out += packed(value);
  return out;
}

// A volume of one macroblock with few distinct bytes, because inputs are limited to 16 KiB.
VolumeContent volume(uint32_t parts) {
  VolumeContent content = tiles_test::testContent(1, parts);
  for (VolumePart& part : content.parts) {
    part.voxels = part.planes = 8;
    part.macroblocks = {0};
    part.voxelBytes.assign(VolumePart::kMacroblockBytes, 100);
    for (auto& plane : part.planeBytes) plane.assign(8 * 8 * VolumePart::kAttributes, 50);
    part.distances = {0};
  }
  return content;
}

std::string toText(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const fs::path root = arguments[1];
  const auto write = [&root](const std::string& name, const auto& content) {
    writeFileAtomically(root / name, content);
  };
  write("colmap_binary/a", colmapBinary());
  write("colmap_text/a", sized("1 OPENCV 64 48 50 51 32 24 .1 -.05 .001 .002\n") +
                             sized("1 1 0 0 0 0 0 2 1 a.jpg\n30 20 5 1 2 -1\n") + "5 .1 .2 .3 1 2 3 .5 1 0\n");
  write("transforms_json/a",
        std::string(
            R"({"camera_angle_x":0.7,"w":64,"h":48,"k1":0.1,"ply_file_path":"p.ply","test_filenames":["a.png"],)"
            R"("applied_scale":2,"applied_transform":[[0,1,0,0],[1,0,0,0],[0,0,-1,0]],"rolling_shutter":[0,0,1],"x":1,)"
            R"("frames":[{"file_path":"a.png","transform_matrix":[[1,0,0,1],[0,1,0,2],[0,0,NaN,3],[0,0,0,1]]}]})"));
  write(
      "transforms_json/b",
      std::string(R"({"tessera":{"version":1,"cameras":[{"model":"FOV","width":64,"height":48,"parameters":[50,50,32,)"
                  R"(24,0.9]}],"geo":{"latitude":1,"enu_from_world":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}},)"
                  R"("frames":[{"file_path":"a","transform_matrix":[[1,0,0,1],[0,1,0,2],[0,0,1,3]],)"
                  R"("tessera":{"camera":0,"gps":{"latitude":1,"longitude":2}}}]})"));
  write("block_grid/a",
        std::string(R"({"origin":[1,2,3],"grid_from_world":[0,1,0,-1,0,0,0,0,1],"edge":40.5,"columns":3,)"
                    R"("rows":2,"bottom":-9,"top":9.5})"));
  write("http_request/a",
        std::string("/scene/tiles/L0/a%20b.glb?v=1\nbytes=0-99\nbr, gzip;q=0.5\nW/\"a-b\", *\n[::1]:80"));
  write("ply/a", encodePly(std::vector<SparsePoint>(2)));
  write("ply/b", std::string("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
                             "double z\nproperty uchar red\nproperty float nx\nend_header\n1 2e3 -3 40 nan\n"));
  const std::string block = exif();
  write("exif/a", encodeJpeg(picture(3), 50, std::as_bytes(std::span(block.data(), block.size()))));
  write("exif/b",
        std::string("\xff\xd8\xff\xe1<x:xmpmeta a:GpsLatitude=\"+1.5\" a:GpsLongtitude='2'><a:GimbalPitchDegree>-90"
                    "</a:GimbalPitchDegree></x:xmpmeta>"));
  for (int channels : {1, 3, 4}) {
    write("image/png" + std::to_string(channels), encodePng(picture(channels)));
    if (channels != 4) write("image/jpeg" + std::to_string(channels), encodeJpeg(picture(channels)));
  }
  write("image/exr", encodeDepthExr(ImageF(9, 7, 1, 2.5f)));
  const std::string values = doubles({1, 2, 3});
  const TensorView tensor{TensorType::f64, {3}, std::as_bytes(std::span(values.data(), values.size()))};
  write("safetensors/a", encodeSafetensors({{"a", tensor}, {"b", tensor}}, {{"key", "value"}}));
  write("camera_path/a",
        std::string(
            R"({"camera_type":"perspective","render_width":64,"render_height":48,"fps":24,"seconds":1,"camera_path":)"
            R"([{"camera_to_world":[1,0,0,1,0,1,0,2,0,0,1,3,0,0,0,1],"fov":50,"aspect":1.3}]})"));
  write("dataparser_transforms/a",
        std::string(R"({"transform":[[0,1,0,0.3],[1,0,0,-0.1],[0,0,-1,-0.08]],"scale":0.125})"));
  write("colmap_database/a", colmapDatabase());
  write("colmap_database/b",
        std::string("Querying for image p0 [1/3] in 0.1s\n  image_id=2, image_name=p1, score=0.1\n"));
  write("video_list/a",
        std::string(R"({"streams":[{"width":640,"height":360,"avg_frame_rate":"30000/1001","duration":"2.5",)"
                    R"("nb_frames":"75"}],"format":{"duration":"2.6"}})"));
  write("video_list/b", std::string("#tb 0: 1/1000\n0,  0,  0, 33, 4800, 0x26d968e4\n0, 33, 33, 33, 4800, 0x1\n"));
  write("video_list/c", std::string("P6\n640 360\n255\n"));
  write("world/a",
        std::string(
            R"({"kind":"tessera world","version":2,"scenes":[{"url":"a"},{"url":"b","position":[1,2,3],"scale":2}],)"
            R"("models":[{"name":"m","files":["m.glb"],"position":[0,0,1],"rotation":[0,0,0,1],"scale":[1,1,1]}],)"
            R"("hidden":[{"name":"h","middle":[0,0,0],"size":[1,2,3],"turn":0.5}],"files":{"m.glb":"AAAA"},)"
            R"("bookmarks":[{"name":"b","view":"eye=1,2,3&target=0,0,0&fov=50"}]})"));
  write("gltf_model/a", testGltf({1, 2, 3}, "1, 0, 0, 0.5"));
  write("gltf_model/b", testGlb({1, 2, 3}, "1, 0, 0, 0.5"));
  write("gltf_model/c", texturedGltf());
  write("world/b", std::string(R"({"kind":"tessera world","version":1,"scene":{"name":"a","url":"a"}})"));
  write("tileset/a", encodeTileset(tiles_test::testTileset(1)));
  write("tileset/b", encodeTileset(tiles_test::testTileset(2, false)));
  for (uint32_t parts : {1u, 2u}) {
    const Bytes file = encodeVolume(volume(parts));
    const auto glb = decodeGlb(file);
    write("volume_payload/whole" + std::to_string(parts), file);
    write("volume_payload/cut" + std::to_string(parts), sized(std::string(glb->json)) + toText(glb->bytes));
  }
  for (uint32_t parts : {1u, 2u}) {
    tiles_test::TestHashContent shape;
    shape.lattice = shape.cells = 8;
    shape.levels = 1;
    HashContent content = tiles_test::testHashContent(1, parts, shape);
    for (HashPart& part : content.parts) std::fill(part.cornerBytes.begin(), part.cornerBytes.end(), uint8_t{100});
    const Bytes file = encodeHash(content);
    const auto glb = decodeGlb(file);
    write("hash_payload/whole" + std::to_string(parts), file);
    write("hash_payload/cut" + std::to_string(parts), sized(std::string(glb->json)) + toText(glb->bytes));
  }
  for (uint32_t parts : {1u, 2u}) {  // the first is a background block with a sky
    const Bytes file = encodeMesh(tiles_test::randomMeshContent(1, parts, parts == 1));
    const auto glb = decodeGlb(file);
    write("mesh_payload/whole" + std::to_string(parts), file);
    write("mesh_payload/cut" + std::to_string(parts), sized(std::string(glb->json)) + toText(glb->bytes));
  }
  write("mesh_payload/inferred", encodeMesh(tiles_test::inferredMeshContent(1)));
  write("mesh_encoder/whole", encodeMeshEncoder(tiles_test::randomMeshEncoder(1)));
  return 0;
}
