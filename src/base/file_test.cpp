#include "base/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <thread>

#include "base/error.h"

namespace tessera {
namespace {

std::string readWholePipe(const fs::path& pipe) {
  std::ifstream in(pipe);
  return {std::istreambuf_iterator<char>(in), {}};
}

class File : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("tessera_file_test_" + std::to_string(::getpid()) + "_" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "root");
    root_ = folder_ / "root";
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_, root_;
};

TEST_F(File, ReadsBackWhatItWroteAndMakesParents) {
  const std::string text("zero \0 byte", 11);
  const fs::path path = root_ / "a" / "b.txt";
  writeFileAtomically(path, std::string_view(text));
  EXPECT_EQ(readTextFile(path), text);
  EXPECT_EQ(readFile(path).size(), 11u);
  writeFileAtomically(path, std::string_view(""), true);
  EXPECT_EQ(readTextFile(path), "");
}

TEST_F(File, LeavesNoPartialFilesBehind) {
  writeFileAtomically(root_ / "a", std::string_view("one"));
  writeFileAtomically(root_ / "a", std::string_view("two"));
  EXPECT_EQ(std::distance(fs::directory_iterator(root_), fs::directory_iterator()), 1);
}

TEST_F(File, KeepsTheOldContentWhenItCannotReplaceIt) {
  fs::create_directory(root_ / "taken");  // a rename over a folder fails
  EXPECT_THROW(writeFileAtomically(root_ / "taken", std::string_view("x")), Error);
  EXPECT_TRUE(fs::is_directory(root_ / "taken"));
  EXPECT_EQ(std::distance(fs::directory_iterator(root_), fs::directory_iterator()), 1);
}

TEST_F(File, WritesIntoPipesAndDevicesInsteadOfReplacingThem) {
  const fs::path pipe = root_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { read = readWholePipe(pipe); });
  writeFileAtomically(pipe, "through");
  reader.join();
  EXPECT_EQ(read, "through");
  EXPECT_TRUE(fs::is_fifo(pipe));

  const fs::path device = root_ / "device";
  fs::create_symlink("/dev/full", device);
  EXPECT_THROW(writeFileAtomically(device, "too much"), Error);
  EXPECT_TRUE(fs::is_character_file(device));
}

TEST_F(File, NamesThePathItCannotRead) {
  try {
    readFile(root_ / "absent.bin");
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), (root_ / "absent.bin").string());
    EXPECT_NE(error.reason().find("No such file"), std::string::npos) << error.what();
  }
  EXPECT_THROW(readFile(root_), Error);
}

TEST_F(File, SaysWhyItCannotMakeTheFolder) {
  // Not even the administrator can make a folder there.
  const fs::path file = "/sys/folder/file.txt";
  try {
    writeFileAtomically(file, std::string_view("text"));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), file.string());
    EXPECT_EQ(error.reason().find("No such file"), std::string::npos) << error.what();
  }
}

TEST_F(File, RejectsFilesAboveTheLimitBeforeReading) {
  const fs::path path = root_ / "huge";
  writeFileAtomically(path, std::string_view("text"));
  fs::resize_file(path, uint64_t{1} << 43);  // sparse: it uses no disk space, but exceeds any machine's memory
  try {
    readFile(path, 1000);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), path.string());
    EXPECT_NE(error.reason().find("8796093022208 bytes"), std::string::npos) << error.what();
    EXPECT_NE(error.reason().find(" 1000 "), std::string::npos) << error.what();
  }
  EXPECT_THROW(readTextFile(path, 1000), Error);
  fs::resize_file(path, 1000);
  EXPECT_EQ(readFile(path, 1000).size(), 1000u);
  EXPECT_THROW(readFile(path, 999), Error);
}

TEST_F(File, ReadsTheStartOfAFileLargerThanMemory) {
  const fs::path path = root_ / "huge";
  writeFileAtomically(path, std::string_view("text"));
  EXPECT_EQ(readFileStart(path, 1000).size(), 4u);
  fs::resize_file(path, uint64_t{1} << 43);
  const Bytes start = readFileStart(path, 6);
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(start.data()), start.size()), std::string("text\0\0", 6));
  EXPECT_TRUE(readFileStart(path, 0).empty());
  EXPECT_THROW(readFileStart(root_ / "absent", 6), Error);
}

TEST_F(File, ResolvesPathsInsideTheFolder) {
  const fs::path real = fs::canonical(root_);
  EXPECT_EQ(resolveInside(root_, "a/b.png"), real / "a/b.png");
  EXPECT_EQ(resolveInside(root_, "./a/../b.png"), real / "b.png");
  EXPECT_EQ(resolveInside(root_, "..a"), real / "..a");
  fs::create_directory(root_ / "inner");
  fs::create_symlink("inner", root_ / "alias");
  EXPECT_EQ(resolveInside(root_, "alias/c.png"), real / "inner/c.png");
}

TEST_F(File, RefusesPathsThatLeaveTheFolder) {
  for (const std::string_view path : {"../x", "a/../../x", "/etc/passwd", "", "a/b/../../../root2/x"}) {
    EXPECT_EQ(resolveInside(root_, path), std::nullopt) << path;
  }
  EXPECT_EQ(resolveInside(root_, std::string_view("a\0b", 3)), std::nullopt);
  fs::create_directory(folder_ / "root_beside");  // its name starts with that of the folder
  EXPECT_EQ(resolveInside(root_, "../root_beside/x"), std::nullopt);
}

TEST_F(File, RefusesLinksThatLeadOut) {
  writeFileAtomically(folder_ / "secret", std::string_view("s"));
  fs::create_symlink(folder_ / "secret", root_ / "file");
  fs::create_symlink("..", root_ / "up");
  fs::create_symlink(folder_ / "not_there_yet", root_ / "dangling");
  fs::create_symlink("circle", root_ / "circle");
  EXPECT_EQ(resolveInside(root_, "file"), std::nullopt);
  EXPECT_EQ(resolveInside(root_, "up/secret"), std::nullopt);
  EXPECT_EQ(resolveInside(root_, "up/root/../secret"), std::nullopt);
  EXPECT_EQ(resolveInside(root_, "dangling"), std::nullopt);
  EXPECT_EQ(resolveInside(root_, "circle"), std::nullopt);
}

TEST_F(File, AcceptsARootThatDoesNotExistYetHoweverItIsWritten) {
  const fs::path future = fs::canonical(root_) / "future";
  EXPECT_EQ(resolveInside(future, "a.png"), future / "a.png");
  EXPECT_EQ(resolveInside(future.string() + "/", "b/a.png"), future / "b/a.png");
  EXPECT_EQ(resolveInside(future.string() + "/", "../a.png"), std::nullopt);
  EXPECT_EQ(resolveInside("/", "a.png"), fs::path("/a.png"));
}

TEST_F(File, AcceptsARootThatIsItselfALink) {
  fs::create_directory_symlink(root_, folder_ / "link");
  EXPECT_EQ(resolveInside(folder_ / "link", "a"), fs::canonical(root_) / "a");
}

TEST(NaturalOrder, PutsNumbersInTheOrderPeopleExpect) {
  std::vector<std::string> names = {"frame_10.png", "frame_2.png", "frame_1.png", "a", "frame_02.png", ""};
  std::sort(names.begin(), names.end(), naturalLess);
  EXPECT_EQ(names, (std::vector<std::string>{"", "a", "frame_1.png", "frame_02.png", "frame_2.png", "frame_10.png"}));
}

TEST(NaturalOrder, IsAStrictWeakOrder) {
  const std::vector<std::string> names = {"",   "0",    "00",  "1",  "01", "001",   "a",
                                          "a0", "a00b", "a0b", "10", "9",  "a9b10", "a9b9"};
  for (const std::string& a : names) {
    EXPECT_FALSE(naturalLess(a, a)) << a;
    for (const std::string& b : names) {
      EXPECT_EQ(naturalLess(a, b) || naturalLess(b, a), a != b) << a << " " << b;
      EXPECT_FALSE(naturalLess(a, b) && naturalLess(b, a)) << a << " " << b;
      for (const std::string& c : names) {
        EXPECT_FALSE(naturalLess(a, b) && naturalLess(b, c) && !naturalLess(a, c)) << a << " " << b << " " << c;
      }
    }
  }
}

TEST(NaturalOrder, ComparesNumbersLongerThanAnyInteger) {
  EXPECT_TRUE(naturalLess("x99999999999999999999998", "x99999999999999999999999"));
  EXPECT_TRUE(naturalLess("x99999999999999999999999", "x100000000000000000000000"));
}

}  // namespace
}  // namespace tessera
