#include "photogrammetry/reconstruction.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <algorithm>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/shared_data.h"
#include "base/testing/temporary_folder.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/colmap_program.h"

namespace tessera {
namespace {

// A program in place of colmap, as a script.
fs::path writeProgram(const TemporaryFolder& folder, const std::string& script) {
  const fs::path file = folder / "program";
  writeFileAtomically(file, "#!/bin/sh\n" + script);
  fs::permissions(file, fs::perms::owner_all);
  return file;
}

std::string errorMessage(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ColmapProgram, IsRefusedInOtherVersions) {
  const TemporaryFolder folder;
  const auto open = [&](const fs::path& program) {
    return errorMessage([&] { ColmapProgram(folder / "log", program.string()); });
  };
  EXPECT_EQ(open(writeProgram(folder, "echo 'COLMAP 3.8 -- Structure-from-Motion'")), "");
  EXPECT_NE(open(writeProgram(folder, "echo 'COLMAP 3.13 -- Structure-from-Motion'")).find("is COLMAP 3.13"),
            std::string::npos);
  EXPECT_NE(open(writeProgram(folder, "echo hello")).find("does not say that it is COLMAP"), std::string::npos);
  EXPECT_NE(open("no-such-program").find("apt-get install colmap"), std::string::npos);
}

TEST(ColmapProgram, FailsWithTheLastWordsOfTheProgram) {
  const TemporaryFolder folder;
  const fs::path program =
      writeProgram(folder, "case $1 in help) echo 'COLMAP 3.8 --';; ok) ;; *) echo no matches; exit 1;; esac");
  ColmapProgram colmap(folder / "log", program.string());
  colmap.run({"ok"});
  const std::string message = errorMessage([&] { colmap.run({"mapper"}); });
  EXPECT_NE(message.find("mapper: ended with status 1: no matches"), std::string::npos) << message;
  EXPECT_EQ(readTextFile(folder / "log"), "no matches\n");
}

// COLMAP's tables, as far as they are used here.
void makeDatabase(const fs::path& file) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &handle), SQLITE_OK);
  const char* tables =
      "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL, width "
      "INTEGER "
      "NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);"
      "CREATE TABLE images(image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE, camera_id "
      "INTEGER NOT NULL);"
      "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL);"
      "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL);"
      "INSERT INTO keypoints VALUES(1, 900), (2, 0);"
      "INSERT INTO two_view_geometries VALUES(2147483649, 77), (2147483650, 0);";
  EXPECT_EQ(sqlite3_exec(handle, tables, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(handle);
}

TEST(ColmapDatabase, HoldsCamerasAndPhotosOnce) {
  const TemporaryFolder folder;
  makeDatabase(folder / "database.db");
  PhotoList list;
  list.bodies = {{"a", 800, 600, 640}, {"b", 600, 800, 0}};
  for (int i = 0; i < 3; ++i) {
    list.photos.emplace_back();
    list.photos.back().safeName = "p" + std::to_string(i);
    list.photos.back().body = i % 2;
  }
  ColmapDatabase database(folder / "database.db");
  database.addPhotos(list);
  database.addPhotos(list);

  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "database.db").c_str(), &handle), SQLITE_OK);
  std::string rows;
  const auto add = [](void* to, int columns, char** values, char**) {
    for (int i = 0; i < columns; ++i) *static_cast<std::string*>(to) += std::string(values[i]) + " ";
    return 0;
  };
  sqlite3_exec(handle, "SELECT camera_id, model, width, height, length(params), prior_focal_length FROM cameras", add,
               &rows, nullptr);
  sqlite3_exec(handle, "SELECT image_id, name, camera_id FROM images", add, &rows, nullptr);
  sqlite3_close(handle);
  EXPECT_EQ(rows, "1 3 800 600 40 1 2 3 600 800 40 0 1 p0 1 2 p1 2 3 p2 1 ");
}

TEST(ColmapDatabase, TellsWhatIsDone) {
  const TemporaryFolder folder;
  makeDatabase(folder / "database.db");
  const ColmapDatabase database(folder / "database.db");
  EXPECT_EQ(database.features(), (std::map<int, int>{{0, 900}, {1, 0}}));
  EXPECT_EQ(database.inliers(), (std::map<PhotoPair, int>{{{0, 1}, 77}, {{0, 2}, 0}}));
}

TEST(ColmapDatabase, IsRefusedIfItIsSomethingElse) {
  const TemporaryFolder folder;
  EXPECT_THROW(ColmapDatabase(folder / "none.db"), Error);
  writeFileAtomically(folder / "text.db", "not a database, but long enough to be looked at as one");
  EXPECT_THROW(ColmapDatabase(folder / "text.db"), Error);
  EXPECT_EQ(readTextFile(folder / "text.db").substr(0, 14), "not a database");
}

TEST(Reconstruction, SaysThatNoPhotosCouldBePlaced) {
  const TemporaryFolder folder;
  PhotoList list;
  list.bodies = {{"a", 800, 600, 640}};
  const fs::path program = writeProgram(
      folder, "case $1 in help) echo 'COLMAP 3.8 --';; *) echo 'ERROR: failed to create sparse model'; exit 1;; esac");
  Reconstruction reconstruction(folder / "poses", list, {.colmap = program.string()});
  const std::string message = errorMessage([&] { reconstruction.map(false, [](int64_t) {}); });
  EXPECT_NE(message.find("no two photos could be placed"), std::string::npos) << message;
  EXPECT_FALSE(fs::exists(folder / "poses/sparse"));
}

// The photos of brighton_beach, and two that its model lacks.
PhotoList beachPhotos() {
  PhotoList list;
  list.bodies = {{"drone", 1600, 900, 889}};
  for (const auto& entry : fs::directory_iterator(sharedData("brighton_beach") / "images"))
    list.photos.push_back({entry.path().filename().string(), entry.path().filename().string(), entry.path(), 0, 0, {}});
  std::sort(list.photos.begin(), list.photos.end(),
            [](const ListedPhoto& a, const ListedPhoto& b) { return a.name < b.name; });
  for (const char* name : {"fog.jpg", "indoors.jpg"}) list.photos.push_back({name, name, name, 0, 0, {}});
  return list;
}

// Stands in for the mapper: it writes a snapshot and fails; with a model to go on from, it returns that model.
std::string mapperScript(const fs::path& model) {
  return "case $1 in help) echo 'COLMAP 3.8 --'; exit;; esac\n"
         "while [ $# -gt 0 ]; do case $1 in --output_path) out=$2;; --input_path) in=$2;; --Mapper.snapshot_path) "
         "snapshots=$2;; esac; shift; done\n"
         "if [ -n \"$in\" ]; then cp $in/* $out; exit; fi\n"
         "mkdir $snapshots/18446744073709551615 $snapshots/7; cp " +
         model.string() +
         "/*.bin $snapshots/18446744073709551615; cp $snapshots/18446744073709551615/images.bin $snapshots/7; exit 1\n";
}

TEST(Reconstruction, GoesOnFromTheLastSnapshotThatIsWhole) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const TemporaryFolder folder;
  const PhotoList list = beachPhotos();
  const fs::path program = writeProgram(folder, mapperScript(sharedData("brighton_beach") / "sparse/0"));
  Reconstruction reconstruction(folder / "poses", list, {.colmap = program.string()});
  EXPECT_THROW(reconstruction.map(false, [](int64_t) {}), Error);
  EXPECT_TRUE(fs::exists(folder / "poses/snapshots/7"));
  reconstruction.map(true, [](int64_t) {});
  EXPECT_EQ(reconstruction.unplacedPhotos(), (std::vector<int>{18, 19}));
  EXPECT_EQ(reconstruction.largestModel().capture.photos.size(), 18u);
  EXPECT_FALSE(fs::exists(folder / "poses/snapshots"));
  EXPECT_THROW(reconstruction.map(false, [](int64_t) {}), Error) << "a new beginning has no snapshot to go on from";
  EXPECT_EQ(reconstruction.largestModel().capture.photos.size(), 18u) << "models remain until others replace them";
}

TEST(Reconstruction, SaysWhyPhotosAreMissing) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const TemporaryFolder folder;
  const PhotoList list = beachPhotos();
  const fs::path program = writeProgram(folder, mapperScript(sharedData("brighton_beach") / "sparse/0"));
  Reconstruction reconstruction(folder / "poses", list, {.colmap = program.string()});
  EXPECT_THROW(reconstruction.map(false, [](int64_t) {}), Error);
  reconstruction.map(true, [](int64_t) {});
  makeDatabase(folder / "poses/database.db");
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "poses/database.db").c_str(), &handle), SQLITE_OK);
  sqlite3_exec(handle, "INSERT INTO keypoints VALUES(19, 12), (20, 4000)", nullptr, nullptr, nullptr);
  sqlite3_close(handle);
  const std::vector<LeftOutPhoto> unplaced = reconstruction.unplaced();
  ASSERT_EQ(unplaced.size(), 2u);
  EXPECT_EQ(unplaced[0].name + ": " + unplaced[0].reason,
            "fog.jpg: few features, as of water, sky or a blurred picture");
  EXPECT_EQ(unplaced[1].name + ": " + unplaced[1].reason, "indoors.jpg: nothing in common with another photo");
}

}  // namespace
}  // namespace tessera
