#include "photogrammetry/photo_matches.h"

#include "base/image_io.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/testing/fake_colmap.h"

namespace tessera {
namespace {

TEST(ColmapProgram, IsRefusedInOtherVersions) {
  const TemporaryFolder folder;
  const auto open = [&](const fs::path& program) {
    return errorMessage([&] { ColmapProgram(folder / "log", program.string()); });
  };
  const auto says = [&](const std::string& words) {
    writeFileAtomically(folder / "other", "#!/bin/sh\necho '" + words + "'\n");
    fs::permissions(folder / "other", fs::perms::owner_all);
    return folder / "other";
  };
  EXPECT_EQ(open(writeColmap(folder, "")), "");
  EXPECT_NE(open(says("COLMAP 3.13 -- Structure-from-Motion")).find("is COLMAP 3.13"), std::string::npos);
  EXPECT_NE(open(says("hello")).find("does not say that it is COLMAP"), std::string::npos);
  EXPECT_NE(open("no-such-program").find("apt-get install colmap"), std::string::npos);
}

TEST(ColmapProgram, FailsWithTheLastWordsOfTheProgram) {
  const TemporaryFolder folder;
  ColmapProgram colmap(folder / "log", writeColmap(folder, "[ $command = ok ] && exit; echo no matches; exit 1"));
  colmap.run({"ok"});
  const std::string message = errorMessage([&] { colmap.run({"mapper"}); });
  EXPECT_NE(message.find("mapper: ended with status 1: no matches"), std::string::npos) << message;
  EXPECT_EQ(readTextFile(folder / "log"), "no matches\n");
}

TEST(ColmapProgram, TellsThatItWasKilledFromThatItFailed) {
  const TemporaryFolder folder;
  const auto run = [&](const std::string& script) {
    ColmapProgram(folder / "log", writeColmap(folder, script)).run({"x"});
  };
  EXPECT_THROW(run("kill -9 $$"), ColmapKilled);
  EXPECT_THROW(run("kill -15 $$"), ColmapKilled);
  const std::string message = errorMessage([&] { run("echo Check failed; kill -6 $$"); });
  EXPECT_NE(message.find("was ended by signal 6: Check failed"), std::string::npos) << message;
  EXPECT_EQ(errorMessage([&] { run("exit 3"); }).find("Check failed"), std::string::npos) << "words of the run before";
}

TEST(ColmapProgram, TellsThatMemoryRanOutWhateverItSaysAfterwards) {
  const TemporaryFolder folder;
  const std::string script = "echo 'what():  std::bad_alloc'; for i in 1 2 3 4 5 6 7 8 9; do echo " +
                             std::string(200, '@') + "; done; kill -6 $$";
  EXPECT_THROW(ColmapProgram(folder / "log", writeColmap(folder, script)).run({"x"}), ColmapKilled);
}

TEST(ColmapProgram, TellsThatItWasKilledBeforeItsVersionWasKnown) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "program", "#!/bin/sh\nkill -2 $$\n");
  fs::permissions(folder / "program", fs::perms::owner_all);
  EXPECT_THROW(ColmapProgram(folder / "log", (folder / "program").string()), ColmapKilled);
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
  ColmapDatabase database(folder / "database.db");
  EXPECT_EQ(database.features(), (std::map<int, int>{{0, 900}, {1, 0}}));
  EXPECT_EQ(database.inliers(), (std::map<PhotoPair, int>{{{0, 1}, 77}, {{0, 2}, 0}}));
  database.removeMatches();
  EXPECT_EQ(database.features().size(), 2u);
  EXPECT_TRUE(database.inliers().empty());
}

TEST(ColmapDatabase, IsRefusedIfItIsSomethingElse) {
  const TemporaryFolder folder;
  EXPECT_THROW(ColmapDatabase(folder / "none.db"), Error);
  writeFileAtomically(folder / "text.db", "not a database, but long enough to be looked at as one");
  EXPECT_THROW(ColmapDatabase(folder / "text.db"), Error);
  EXPECT_EQ(readTextFile(folder / "text.db").substr(0, 14), "not a database");
}

TEST(PhotoMatches, TakeAsManyThreadsAsMemoryAllows) {
  constexpr int64_t kGiB = int64_t{1} << 30;
  EXPECT_EQ(extractionThreads(16, 800 * 600, 16 * kGiB), 16);
  // 12 megapixels, reduced to 3200×2400 pixels: 2.6 GiB for each.
  const int64_t pixels = extractedPixels({"camera", 4000, 3000, 0});
  EXPECT_EQ(pixels, 3200 * 2400);
  EXPECT_EQ(extractedPixels({"camera", 600, 800, 0}), 600 * 800);
  EXPECT_EQ(extractionThreads(16, pixels, 16 * kGiB), 4);
  EXPECT_EQ(extractionThreads(16, pixels, kGiB), 1);
  EXPECT_GE(extractionThreads(0, 800 * 600, 16 * kGiB), 1);
}

// COLMAP passes over photos that it cannot read, and reports success.
TEST(PhotoMatches, ReadPhotosAgainThatWereAwayOrSayThatTheyAre) {
  const TemporaryFolder folder;
  for (const char* name : {"made.db", "all.db"}) makeDatabase(folder / name);
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "all.db").c_str(), &handle), SQLITE_OK);
  sqlite3_exec(handle, "INSERT INTO keypoints VALUES(3, 500)", nullptr, nullptr, nullptr);
  sqlite3_close(handle);
  PhotoList list = numberedPhotos(3);
  for (ListedPhoto& photo : list.photos) {
    photo.file = folder / photo.name;
    writeJpeg(photo.file, ImageU8(8, 6, 3));
  }
  const std::string runs = (folder / "runs").string();
  // The third photo gets features the second time.
  const std::string script = "case $command in database_creator) cp " + (folder / "made.db").string() +
                             " $database_path;; feature_extractor) echo run >> " + runs + "; [ $(wc -l < " + runs +
                             ") = 2 ] && cp " + (folder / "all.db").string() + " $database_path;; esac; true";
  const auto extract = [&] {
    fs::remove(runs);
    fs::remove_all(folder / "poses");
    PhotoMatches matches(folder / "poses", list, {.program = writeColmap(folder, script).string()});
    const std::string message = errorMessage([&] { matches.extractFeatures([](int64_t) {}); });
    return message + std::to_string(matches.count().photos) + " " + readTextFile(runs);
  };
  EXPECT_EQ(extract(), "3 run\nrun\n");
  writeFileAtomically(list.photos[2].file, std::string_view("damaged"));
  EXPECT_EQ(extract(), "2 run\n");
  fs::remove(list.photos[2].file);
  EXPECT_EQ(extract().find(list.photos[2].file.string() + ": No such file"), 0u) << extract();
}

// Pair 0 and 2 is in the tables; the script adds another, and fails.
TEST(PhotoMatches, AreDoneIfTheTablesSaySoWhateverTheProgramReports) {
  const TemporaryFolder folder;
  for (const char* name : {"database.db", "later.db"}) {
    makeDatabase(folder / name);
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open((folder / name).c_str(), &handle), SQLITE_OK);
    sqlite3_exec(handle, "INSERT INTO keypoints VALUES(3, 500)", nullptr, nullptr, nullptr);
    sqlite3_close(handle);
  }
  addInliers(folder / "later.db", 1, 2, 60);
  const PhotoList list = numberedPhotos(3);
  const auto match = [&](const std::string& script) {
    PhotoMatches matches(folder.path(), list, {.program = writeColmap(folder, script).string()});
    return errorMessage([&] { matches.match({{0, 2}, {1, 2}}, [](int64_t) {}); });
  };
  EXPECT_NE(match("echo broken; exit 1").find("broken"), std::string::npos);
  EXPECT_EQ(match("cp " + (folder / "later.db").string() + " $database_path; exit 1"), "");
}

TEST(PhotoMatches, SearchForLookAlikesOfThePhotosAskedForAlone) {
  const TemporaryFolder folder;
  makeDatabase(folder / "database.db");
  const PhotoList list = numberedPhotos(3);
  const std::string script =
      "case $command in vocab_tree_builder) : > $vocab_tree_path;;\n"
      "*) cp $query_image_list_path " +
      (folder / "asked").string() +
      "; echo 'Querying for image p1.jpg [1/1]'; echo '  image_id=3, image_name=p2.jpg, score=1';; esac";
  PhotoMatches matches(folder.path(), list, {.program = writeColmap(folder, script).string()});
  // The last one has no features, so that it could not be asked for.
  EXPECT_EQ(matches.findLookAlikes({1, 2}, [](int64_t) {}), (LookAlikes{{}, {2}, {}}));
  EXPECT_EQ(readTextFile(folder / "asked"), "p1.jpg\n");
  EXPECT_EQ(matches.findLookAlikes({2}, [](int64_t) {}), LookAlikes(3));
}

TEST(PhotoMatches, SayWhyPhotosHaveNoPose) {
  const TemporaryFolder folder;
  makeDatabase(folder / "database.db");
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder / "database.db").c_str(), &handle), SQLITE_OK);
  sqlite3_exec(handle, "INSERT INTO keypoints VALUES(3, 12), (4, 4000)", nullptr, nullptr, nullptr);
  sqlite3_close(handle);
  const PhotoList list = numberedPhotos(5);
  std::string reasons;
  for (const LeftOutPhoto& photo : PhotoMatches(folder.path(), list, {}).explain({0, 1, 2, 3, 4}, {1}))
    reasons += photo.name + ": " + photo.reason + "\n";
  EXPECT_EQ(reasons,
            "p0.jpg: not consistent with the others\n"
            "p1.jpg: in another model, of another place or with too few matches to the rest\n"
            "p2.jpg: few features, as of water, sky or a blurred picture\n"
            "p3.jpg: nothing in common with another photo\n"
            "p4.jpg: not decodable\n");
}

}  // namespace
}  // namespace tessera
