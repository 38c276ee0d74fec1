#include "photogrammetry/colmap_database.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <functional>

#include "base/error.h"

namespace tessera {
namespace {

constexpr int kRadialLens = 3;               // COLMAP's number of RADIAL: f, cx, cy, k1, k2
constexpr double kAssumedFocalFactor = 1.2;  // of the longer side: COLMAP's default
constexpr int64_t kPairFactor = 2147483647;  // pair_id = kPairFactor × smaller number + larger number
constexpr int kBusyMilliseconds = 10000;

}  // namespace

struct ColmapDatabase::State {
  sqlite3* handle = nullptr;
  fs::path file;

  ~State() { sqlite3_close(handle); }

  [[noreturn]] void fail() const {
    throw Error(file.string(), "", fmt::format("COLMAP's database: {}", sqlite3_errmsg(handle)),
                "remove the file: it is then made again");
  }

  // Runs a statement with bound values, and calls `row` for each row of its result.
  using Row = std::function<void(sqlite3_stmt*)>;
  void query(const char* sql, const std::function<void(sqlite3_stmt*)>& bind, const Row& row) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(handle, sql, -1, &statement, nullptr) != SQLITE_OK) fail();
    const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> owner(statement, sqlite3_finalize);
    if (bind) bind(statement);
    int status = SQLITE_ROW;
    while ((status = sqlite3_step(statement)) == SQLITE_ROW) {
      if (row) row(statement);
    }
    if (status != SQLITE_DONE) fail();
  }
  void run(const char* sql) const { query(sql, {}, {}); }
};

ColmapDatabase::ColmapDatabase(const fs::path& file) : state_(std::make_unique<State>()) {
  state_->file = file;
  if (sqlite3_open_v2(file.c_str(), &state_->handle, SQLITE_OPEN_READWRITE, nullptr) != SQLITE_OK) state_->fail();
  sqlite3_busy_timeout(state_->handle, kBusyMilliseconds);
  state_->run("SELECT image_id, name, camera_id FROM images LIMIT 1");
  state_->run("SELECT pair_id, rows FROM two_view_geometries LIMIT 1");
}

ColmapDatabase::~ColmapDatabase() = default;

void ColmapDatabase::addPhotos(const PhotoList& list) {
  state_->run("BEGIN");
  for (size_t i = 0; i < list.bodies.size(); ++i) {
    const CameraBody& body = list.bodies[i];
    const double focal =
        body.focalLength > 0 ? body.focalLength : kAssumedFocalFactor * std::max(body.width, body.height);
    const double parameters[] = {focal, 0.5 * body.width, 0.5 * body.height, 0, 0};
    state_->query(
        "INSERT OR IGNORE INTO cameras(camera_id, model, width, height, params, prior_focal_length) "
        "VALUES(?, ?, ?, ?, ?, ?)",
        [&](sqlite3_stmt* s) {
          sqlite3_bind_int64(s, 1, static_cast<int64_t>(i) + 1);
          sqlite3_bind_int(s, 2, kRadialLens);
          sqlite3_bind_int(s, 3, body.width);
          sqlite3_bind_int(s, 4, body.height);
          sqlite3_bind_blob(s, 5, parameters, sizeof parameters, SQLITE_TRANSIENT);
          sqlite3_bind_int(s, 6, body.focalLength > 0 ? 1 : 0);
        },
        {});
  }
  for (size_t i = 0; i < list.photos.size(); ++i) {
    const ListedPhoto& photo = list.photos[i];
    state_->query("INSERT OR IGNORE INTO images(image_id, name, camera_id) VALUES(?, ?, ?)",
                  [&](sqlite3_stmt* s) {
                    sqlite3_bind_int64(s, 1, static_cast<int64_t>(i) + 1);
                    sqlite3_bind_text(s, 2, photo.safeName.c_str(), -1, SQLITE_TRANSIENT);
                    sqlite3_bind_int(s, 3, photo.body + 1);
                  },
                  {});
  }
  state_->run("COMMIT");
}

std::map<int, int> ColmapDatabase::features() const {
  std::map<int, int> counts;
  state_->query("SELECT image_id, rows FROM keypoints", {}, [&](sqlite3_stmt* s) {
    counts[static_cast<int>(sqlite3_column_int64(s, 0)) - 1] = sqlite3_column_int(s, 1);
  });
  return counts;
}

void ColmapDatabase::removeMatches() {
  for (const char* sql : {"BEGIN", "DELETE FROM matches", "DELETE FROM two_view_geometries", "COMMIT"})
    state_->run(sql);
}

std::map<PhotoPair, int> ColmapDatabase::inliers() const {
  std::map<PhotoPair, int> counts;
  state_->query("SELECT pair_id, rows FROM two_view_geometries", {}, [&](sqlite3_stmt* s) {
    const int64_t pair = sqlite3_column_int64(s, 0);
    counts[{static_cast<int>(pair / kPairFactor) - 1, static_cast<int>(pair % kPairFactor) - 1}] =
        sqlite3_column_int(s, 1);
  });
  return counts;
}

}  // namespace tessera
