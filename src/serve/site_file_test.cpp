#include "serve/site_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class SiteFileTest : public testing::Test {
 protected:
  SiteFileTest() {
    fs::create_directories(site_ / "tiles");
    writeFileAtomically(site_ / "tiles/a.glb", std::string_view("inside"));
    writeFileAtomically(folder_ / "secret.txt", std::string_view("secret"));
  }

  std::shared_ptr<const SiteFile> open(const std::string& relative) const {
    return SiteFile::open(site_, relative).file;
  }
  static std::string readText(const SiteFile& file) {
    std::string text(file.bytes(), '\0');
    return file.read(0, text) ? text : "cut off";
  }

  TemporaryFolder folder_;
  fs::path site_ = folder_.path() / "site";
};

TEST_F(SiteFileTest, FollowsLinksThatEndInsideWhereverTheyLead) {
  fs::create_symlink("a.glb", site_ / "tiles/beside.glb");
  fs::create_symlink(site_ / "tiles/a.glb", site_ / "absolute.glb");
  fs::create_directory_symlink(folder_.path(), site_ / "up");
  for (const char* path : {"tiles/a.glb", "tiles/beside.glb", "absolute.glb", "up/site/tiles/a.glb"}) {
    const auto file = open(path);
    ASSERT_TRUE(file) << path;
    EXPECT_EQ(readText(*file), "inside") << path;
    EXPECT_EQ(file->path(), site_ / "tiles/a.glb") << path;
  }
}

TEST_F(SiteFileTest, OpensNothingOutsideOrHidden) {
  writeFileAtomically(folder_ / "site-beside/a.txt", std::string_view("secret"));
  writeFileAtomically(site_ / ".git/config", std::string_view("secret"));
  fs::create_symlink(folder_ / "secret.txt", site_ / "out.txt");
  fs::create_directory_symlink(folder_ / "site-beside", site_ / "beside");
  fs::create_symlink(".git/config", site_ / "shown.txt");
  fs::create_symlink("loop", site_ / "loop");
  fs::create_symlink("/proc/self/environ", site_ / "environ");
  for (const std::string& path :
       {std::string(), std::string("."), std::string("tiles"), std::string("tiles/"), std::string("tiles/a.glb/"),
        std::string("tiles/b.glb"), std::string("../secret.txt"), std::string("../site-beside/a.txt"),
        std::string("out.txt"), std::string("beside/a.txt"), std::string("shown.txt"), std::string(".git/config"),
        std::string("loop"), std::string("environ"), std::string("/etc/passwd"), std::string(300, 'a'),
        std::string(20000, 'a')}) {
    EXPECT_FALSE(open(path)) << path.substr(0, 80);
  }
}

TEST_F(SiteFileTest, DoesNotOpenPipes) {
  ASSERT_EQ(::mkfifo((site_ / "pipe").c_str(), 0600), 0);
  EXPECT_FALSE(open("pipe"));  // returns without blocking
}

TEST_F(SiteFileTest, KeepsReadingTheOpenedFile) {
  const auto file = open("tiles/a.glb");
  fs::remove(site_ / "tiles/a.glb");
  fs::create_symlink(folder_ / "secret.txt", site_ / "tiles/a.glb");
  EXPECT_EQ(readText(*file), "inside");
  EXPECT_FALSE(open("tiles/a.glb"));
}

TEST_F(SiteFileTest, NeverLeavesTheFolderWhileLinksAreSwapped) {
  fs::create_symlink("tiles", site_ / "in");
  fs::create_symlink(folder_.path(), site_ / "out");
  writeFileAtomically(folder_ / "a.glb", std::string_view("secret"));
  fs::create_symlink("tiles", site_ / "now");
  std::atomic<bool> ended = false;
  std::thread swapper([&] {
    for (bool out = true; !ended; out = !out) {
      std::error_code ignored;
      fs::copy_symlink(site_ / (out ? "out" : "in"), site_ / "next", ignored);
      fs::rename(site_ / "next", site_ / "now", ignored);
    }
  });
  int opened = 0;
  for (int i = 0; i < 20000 || (opened == 0 && i < 1000000); ++i) {
    if (const auto file = open("now/a.glb")) {
      ++opened;
      EXPECT_EQ(readText(*file), "inside");
    }
  }
  ended = true;
  swapper.join();
  EXPECT_GT(opened, 0);
}

TEST_F(SiteFileTest, KeepsItsPathAfterItWasReplaced) {
  // A file may be replaced between being resolved and being examined; an open descriptor simulates that.
  const std::string path = (site_ / "tiles/a.glb").string();
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_GE(descriptor, 0);
  fs::create_symlink("/proc/self/fd/" + std::to_string(descriptor), site_ / "link.glb");
  writeFileAtomically(path, std::string_view("newer"));
  const auto file = open("link.glb");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->path(), path);
  EXPECT_EQ(readText(*file), "inside");
  ::close(descriptor);
}

TEST_F(SiteFileTest, ReportsThatItWasTruncated) {
  const auto file = open("tiles/a.glb");
  fs::resize_file(site_ / "tiles/a.glb", 3);
  std::string text(6, '\0');
  EXPECT_FALSE(file->read(0, text));
  EXPECT_FALSE(file->read(UINT64_MAX - 2, text));
  text.resize(3);
  EXPECT_TRUE(file->read(0, text));
  EXPECT_EQ(text, "ins");
}

TEST_F(SiteFileTest, HasATagThatChangesWithIt) {
  const std::string tag = open("tiles/a.glb")->tag();
  EXPECT_EQ(open("tiles/a.glb")->tag(), tag);
  writeFileAtomically(site_ / "tiles/a.glb", std::string_view("longer than that"));
  EXPECT_NE(open("tiles/a.glb")->tag(), tag);
}

TEST_F(SiteFileTest, DistinguishesTooManyOpenFilesFromAMissingFile) {
  rlimit limit{}, none{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  none = limit;
  none.rlim_cur = 0;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const SiteFile::Opening opening = SiteFile::open(site_, "tiles/a.glb");
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_FALSE(opening.file);
  EXPECT_TRUE(opening.isBusy);
  EXPECT_FALSE(SiteFile::open(site_, "tiles/b.glb").isBusy);
}

}  // namespace
}  // namespace tessera
