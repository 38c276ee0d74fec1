#include "base/readable_file.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(ReadableFiles, AreThere) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "file", std::string_view("text"));
  fs::create_symlink(folder / "file", folder / "link");
  fs::create_symlink(folder / "absent", folder / "dangling");
  fs::create_symlink(folder / "loop", folder / "loop");
  EXPECT_TRUE(isReadableFile(folder / "file"));
  EXPECT_TRUE(isReadableFile(folder / "link"));
  for (const char* name : {"", "absent", "dangling", "loop", "file/below"})
    EXPECT_FALSE(isReadableFile(folder / name)) << name;
}

TEST(ReadableFiles, AreNotSaidToBeAbsentIfADiskFails) {
  for (const std::errc code : {std::errc::io_error, std::errc::not_connected, std::errc::timed_out})
    EXPECT_FALSE(meansAbsence(std::make_error_code(code)));
  EXPECT_TRUE(meansAbsence(std::make_error_code(std::errc::permission_denied)));
}

}  // namespace
}  // namespace tessera
