// Stand-ins for COLMAP: scripts in place of the program, its tables and its models.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

// A program in place of colmap, as a script that is run for each command but `help`; it finds the values of flags such
// as --output_path as $output_path. `mapsRest`: also for the mapper of photos that the first model lacks, which makes
// no model otherwise.
inline fs::path writeColmap(const TemporaryFolder& folder, const std::string& script, bool mapsRest = false) {
  const fs::path file = folder / "program";
  writeFileAtomically(
      file,
      "#!/bin/sh\ncommand=$1; shift\n"
      "if [ $command = help ]; then echo 'COLMAP 3.8 -- Structure-from-Motion'; exit; fi\n"
      "while [ $# -gt 1 ]; do eval \"$(echo ${1#--} | tr . _)=\\$2\"; shift 2; done\n" +
          std::string(
              mapsRest ? "" : "if [ -n \"$image_list_path\" ]; then echo failed to create sparse model; exit 1; fi\n") +
          script + "\n");
  fs::permissions(file, fs::perms::owner_all);
  return file;
}

inline std::string errorMessage(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// Adds to COLMAP's tables that two photos, by their indices, have been compared.
inline void addInliers(const fs::path& file, int first, int second, int inliers) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &handle), SQLITE_OK);
  const int64_t pair = (first + 1) * int64_t{2147483647} + second + 1;
  const std::string row =
      "INSERT INTO two_view_geometries VALUES(" + std::to_string(pair) + ", " + std::to_string(inliers) + ");";
  EXPECT_EQ(sqlite3_exec(handle, row.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(handle);
}

// COLMAP's tables, as far as they are used here, with features of the first two photos and two compared pairs.
inline void makeDatabase(const fs::path& file) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &handle), SQLITE_OK);
  const char* tables =
      "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL, width "
      "INTEGER "
      "NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);"
      "CREATE TABLE images(image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE, camera_id "
      "INTEGER NOT NULL);"
      "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL);"
      "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL);"
      "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL);"
      "INSERT INTO keypoints VALUES(1, 900), (2, 0);"
      "INSERT INTO two_view_geometries VALUES(2147483649, 77), (2147483650, 0);";
  EXPECT_EQ(sqlite3_exec(handle, tables, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(handle);
}

// A list of photos of one camera: p0.jpg, p1.jpg, …
inline PhotoList numberedPhotos(int count) {
  PhotoList list;
  list.bodies = {{"drone", 800, 600, 640}};
  for (int i = 0; i < count; ++i) {
    const std::string name = "p" + std::to_string(i) + ".jpg";
    list.photos.push_back({name, name, fs::path("/photos") / name, 0, 0, {}});
  }
  return list;
}

struct FakeLens {
  int32_t model = 3;  // RADIAL
  std::vector<double> parameters{640, 400, 300, 0, 0};
};

// Writes a binary model with these photos, a metre apart, of one camera.
inline void writeModel(const fs::path& folder, const std::vector<int>& photos, const FakeLens& lens = {},
                       int points = 1000) {
  std::string bytes;
  const auto append = [&bytes](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  append(uint64_t{1});
  append(uint32_t{1});
  append(lens.model);
  append(uint64_t{800});
  append(uint64_t{600});
  for (const double parameter : lens.parameters) append(parameter);
  writeFileAtomically(folder / "cameras.bin", bytes);
  bytes.clear();
  append(static_cast<uint64_t>(photos.size()));
  for (const int photo : photos) {
    append(static_cast<uint32_t>(photo + 1));
    for (const double value : {1.0, 0.0, 0.0, 0.0, static_cast<double>(-photo), 0.0, 0.0}) append(value);
    append(uint32_t{1});
    bytes += "p" + std::to_string(photo) + ".jpg";
    append(char{0});
    append(uint64_t{0});
  }
  writeFileAtomically(folder / "images.bin", bytes);
  bytes.clear();
  append(static_cast<uint64_t>(points));
  for (int point = 0; point < points; ++point) {
    append(static_cast<uint64_t>(point + 1));
    for (const double x : {0.01 * point, 0.0, 10.0}) append(x);
    for (int channel = 0; channel < 3; ++channel) append(uint8_t{128});
    append(0.5);
    append(uint64_t{0});
  }
  writeFileAtomically(folder / "points3D.bin", bytes);
}

}  // namespace tessera
