#include "serve/static_site.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

std::string findHeader(const SiteAnswer& answer, const std::string& name) {
  for (const auto& [key, value] : answer.headers) {
    if (key == name) return value;
  }
  return "";
}

class StaticSiteTest : public testing::Test {
 protected:
  StaticSiteTest() {
    write("viewer/index.html", "<!doctype html>");
    write("viewer/assets/index-aB3_x9Zq.js", std::string(5000, 'x'));
    write("scene/tileset.json", "{\"asset\":" + std::string(5000, ' ') + "{}}");
    write("scene/tiles/L0/a-0123456789abcdef.glb", "0123456789");
    write("scene/assets/bus-mesh2024.gltf", "{}");
    write("scene/.hidden", "secret");
    write("secret.txt", "secret");
    write("scene-beside/secret.txt", "secret");
    fs::create_symlink(folder_.path() / "secret.txt", folder_.path() / "scene/link.txt");
    fs::create_directory_symlink(folder_.path(), folder_.path() / "scene/up");
    fs::create_symlink("tileset.json", folder_.path() / "scene/inner.json");
    fs::create_symlink(".hidden", folder_.path() / "scene/shown.txt");
  }

  void write(const std::string& name, const std::string& text) {
    const fs::path path = folder_.path() / name;
    fs::create_directories(path.parent_path());
    writeFileAtomically(path, text);
  }

  StaticSite site(std::vector<std::string> hosts = {}) const {
    return StaticSite({{"", folder_.path() / "viewer"}, {"scene", folder_.path() / "scene"}}, std::move(hosts));
  }

  SiteAnswer get(const std::string& target) const { return site().answer({.target = target}); }

  TemporaryFolder folder_;
};

TEST_F(StaticSiteTest, ServesFilesOfItsFolders) {
  const SiteAnswer index = get("/");
  EXPECT_EQ(index.status, 200);
  EXPECT_EQ(findHeader(index, "Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(index.file->path().filename(), "index.html");
  EXPECT_EQ(get("/scene/tileset.json?x").file->path().filename(), "tileset.json");
  EXPECT_EQ(get("/scene/inner.json").status, 200) << "a link that stays inside";
  EXPECT_EQ(findHeader(get("/scene/tiles/L0/a-0123456789abcdef.glb"), "Content-Type"), "model/gltf-binary");
}

TEST_F(StaticSiteTest, ServesNothingOutsideItsFolders) {
  for (const char* target : {"/secret.txt",
                             "/../secret.txt",
                             "/scene/../secret.txt",
                             "/scene/..%2fsecret.txt",
                             "/scene/%2e%2e/secret.txt",
                             "/scene/%2e%2e%2fsecret.txt",
                             "/scene/..%5csecret.txt",
                             "/scene//secret.txt",
                             "/scene/link.txt",
                             "/scene/up/secret.txt",
                             "/scene/.hidden",
                             "/scene/shown.txt",
                             "/scene-beside/secret.txt",
                             "/scene",
                             "/scene/",
                             "/scene/tiles",
                             "/scene/tiles/",
                             "/scene/tileset.json/",
                             "/etc/passwd",
                             "//etc/passwd",
                             "/scene/%00tileset.json",
                             "/scene/tileset.json%00.glb",
                             "scene/tileset.json",
                             "*",
                             "",
                             "/scene/nothing.glb"}) {
    const SiteAnswer answer = get(target);
    EXPECT_EQ(answer.status, 404) << target;
    EXPECT_FALSE(answer.file) << target;
    EXPECT_EQ(answer.body.find("secret"), std::string::npos) << target;
  }
}

TEST_F(StaticSiteTest, MarksContentAddressedFilesAsImmutable) {
  EXPECT_EQ(findHeader(get("/scene/tiles/L0/a-0123456789abcdef.glb"), "Cache-Control"),
            "public, max-age=31536000, immutable");
  EXPECT_EQ(findHeader(get("/assets/index-aB3_x9Zq.js"), "Cache-Control"), "public, max-age=31536000, immutable");
  EXPECT_EQ(findHeader(get("/scene/assets/bus-mesh2024.gltf"), "Cache-Control"), "no-cache") << "a user's own name";
  EXPECT_EQ(findHeader(get("/scene/tileset.json"), "Cache-Control"), "no-cache");
  EXPECT_EQ(findHeader(get("/"), "Cache-Control"), "no-cache");
}

TEST_F(StaticSiteTest, AnswersNotModifiedUntilTheFileChanges) {
  const StaticSite site = this->site();
  const std::string tag = findHeader(site.answer({.target = "/scene/tileset.json"}), "ETag");
  const SiteAnswer same = site.answer({.target = "/scene/tileset.json", .ifNoneMatch = tag});
  EXPECT_EQ(same.status, 304);
  EXPECT_FALSE(same.file);
  EXPECT_EQ(findHeader(same, "ETag"), tag);
  write("scene/tileset.json", "{}");
  EXPECT_EQ(site.answer({.target = "/scene/tileset.json", .ifNoneMatch = tag}).status, 200);
}

TEST_F(StaticSiteTest, ServesPartsOfFiles) {
  const std::string target = "/scene/tiles/L0/a-0123456789abcdef.glb";
  const StaticSite site = this->site();
  const SiteAnswer part = site.answer({.target = target, .range = "bytes=2-4"});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.bytes, (ByteRange{2, 5}));
  EXPECT_EQ(part.length, 3u);
  EXPECT_EQ(findHeader(part, "Content-Range"), "bytes 2-4/10");
  const SiteAnswer outside = site.answer({.target = target, .range = "bytes=10-"});
  EXPECT_EQ(outside.status, 416);
  EXPECT_EQ(findHeader(outside, "Content-Range"), "bytes */10");
  const std::string tag = findHeader(part, "ETag");
  EXPECT_EQ(site.answer({.target = target, .range = "bytes=2-4", .ifRange = tag}).status, 206);
  EXPECT_EQ(site.answer({.target = target, .range = "bytes=2-4", .ifRange = "\"old\""}).status, 200);
}

TEST_F(StaticSiteTest, CompressesText) {
  const StaticSite site = this->site();
  const SiteAnswer answer = site.answer({.target = "/scene/tileset.json", .acceptEncoding = "gzip"});
  EXPECT_TRUE(answer.isGzipped);
  EXPECT_EQ(answer.file->path().filename(), "tileset.json");
  EXPECT_EQ(findHeader(answer, "Content-Encoding"), "gzip");
  EXPECT_EQ(findHeader(answer, "Vary"), "Accept-Encoding");
  const std::string tag = findHeader(answer, "ETag");
  EXPECT_NE(tag, findHeader(site.answer({.target = "/scene/tileset.json"}), "ETag"));
  const SiteAnswer same = site.answer({.target = "/scene/tileset.json", .ifNoneMatch = tag, .acceptEncoding = "gzip"});
  EXPECT_EQ(same.status, 304);
  EXPECT_FALSE(same.isGzipped) << "an answer without a body is not compressed";
  EXPECT_FALSE(site.answer({.target = "/scene/tileset.json"}).isGzipped);
  EXPECT_FALSE(
      site.answer({.target = "/scene/tileset.json", .range = "bytes=0-9", .acceptEncoding = "gzip"}).isGzipped);
  EXPECT_FALSE(site.answer({.target = "/scene/tiles/L0/a-0123456789abcdef.glb", .acceptEncoding = "gzip"}).isGzipped);
  EXPECT_FALSE(site.answer({.target = "/", .acceptEncoding = "gzip"}).isGzipped) << "too small to be worth it";
}

TEST_F(StaticSiteTest, AcceptsOnlyGetAndHead) {
  const SiteAnswer head = site().answer({.method = "HEAD", .target = "/scene/tileset.json"});
  EXPECT_EQ(head.status, 200);
  EXPECT_FALSE(head.sendsBody);
  EXPECT_GT(head.length, 5000u);
  for (const char* method : {"POST", "PUT", "DELETE", "TRACE", ""}) {
    const SiteAnswer refused = site().answer({.method = method, .target = "/"});
    EXPECT_EQ(refused.status, 405) << method;
    EXPECT_EQ(findHeader(refused, "Allow"), "GET, HEAD");
  }
}

TEST_F(StaticSiteTest, AnswersOnlyToItsHosts) {
  const StaticSite site = this->site({"localhost", "127.0.0.1"});
  EXPECT_EQ(site.answer({.target = "/", .host = "localhost:8080"}).status, 200);
  EXPECT_EQ(site.answer({.target = "/", .host = "127.0.0.1"}).status, 200);
  for (const char* host : {"", "example.com", "localhost.example.com:8080", "[::1"}) {
    EXPECT_EQ(site.answer({.target = "/", .host = host}).status, 421) << host;
  }
}

TEST_F(StaticSiteTest, RedirectsToItsStartPage) {
  const StaticSite site({{"", folder_.path() / "viewer"}}, {}, "?world=world/world.json");
  const SiteAnswer onward = site.answer({.target = "/"});
  EXPECT_EQ(onward.status, 302);
  EXPECT_EQ(findHeader(onward, "Location"), "?world=world/world.json");
  EXPECT_EQ(findHeader(onward, "Cache-Control"), "no-store");
  EXPECT_EQ(site.answer({.target = "/?world=world/world.json"}).status, 200);
  EXPECT_EQ(site.answer({.target = "/index.html"}).status, 200);
  EXPECT_EQ(get("/").status, 200) << "a site without a start page";
}

TEST_F(StaticSiteTest, RejectsMissingFolders) {
  EXPECT_THROW(StaticSite({{"", folder_.path() / "nothing"}}, {}), Error);
  EXPECT_THROW(StaticSite({{"", folder_.path() / "secret.txt"}}, {}), Error);
}

}  // namespace
}  // namespace tessera
