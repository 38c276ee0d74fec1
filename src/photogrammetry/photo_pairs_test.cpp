#include "photogrammetry/photo_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "photogrammetry/look_alikes.h"
#include "photogrammetry/testing/survey_list.h"

namespace tessera {
namespace {

int groups(const PhotoList& list, const std::vector<PhotoPair>& pairs) {
  std::vector<int> group(list.photos.size());
  std::iota(group.begin(), group.end(), 0);
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& [a, b] : pairs) {
      int &x = group[static_cast<size_t>(a)], &y = group[static_cast<size_t>(b)];
      changed = changed || x != y;
      x = y = std::min(x, y);
    }
  }
  return static_cast<int>(std::set<int>(group.begin(), group.end()).size());
}

TEST(PhotoPairs, AreAllOfAFewPhotos) {
  EXPECT_EQ(choosePairs(survey(4, 5, 15), {}).size(), 20u * 19 / 2);
}

TEST(PhotoPairs, AreThoseThatOverlap) {
  const PhotoList list = survey(12, 12, 15);
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_LE(pairs.size(), 144u * 16);
  EXPECT_GE(pairs.size(), 144u * 5);
  EXPECT_EQ(groups(list, pairs), 1);
  for (const auto& [a, b] : pairs) {
    EXPECT_LT(a, b);
    const GpsFix &x = *list.photos[static_cast<size_t>(a)].tags.gps, &y = *list.photos[static_cast<size_t>(b)].tags.gps;
    const double apart = std::hypot(x.latitude - y.latitude, x.longitude - y.longitude) * kMetresPerDegree;
    EXPECT_LT(apart, 65) << a << " " << b;
  }
  EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
  // Neighbours of another line, which the sequence alone does not connect.
  EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(6, 17)));
}

TEST(PhotoPairs, ConnectFlightsOfOtherHeightsAndAngles) {
  PhotoList list = survey(7, 7, 15);
  for (int k = 0; k < 7; ++k) {
    // Twice as high; and oblique ones that look north at the same places from the south.
    list.photos.push_back(photoAt(15.0 * k, 45, 120, {0, -90, 0}, 1, 1000 + 3 * k));
    list.photos.push_back(photoAt(15.0 * k, -5, 60, {0, -50, 0}, 2, 2000 + 3 * k));
  }
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_EQ(groups(list, pairs), 1);
  for (size_t i = 49; i < list.photos.size(); ++i) {
    const int own = list.photos[i].flight;
    const auto others = std::count_if(pairs.begin(), pairs.end(), [&](const PhotoPair& pair) {
      const auto a = static_cast<size_t>(pair.first), b = static_cast<size_t>(pair.second);
      return (a == i && list.photos[b].flight != own) || (b == i && list.photos[a].flight != own);
    });
    EXPECT_GE(others, 4) << i;
  }
}

// A photo every three metres: many of the same line overlap more than any of the next one, but show places from nearly
// the same side.
TEST(PhotoPairs, ConnectDenseLinesWithTheLinesBesideThem) {
  PhotoList list;
  list.bodies = survey(1, 1, 1).bodies;
  const int perLine = 60;
  for (int i = 0; i < 4 * perLine; ++i) {
    const int line = i / perLine, k = i % perLine, column = line % 2 == 0 ? k : perLine - 1 - k;
    list.photos.push_back(photoAt(3 * column, 25 * line, 60, {90, -90, 0}, 0, 2 * i));
  }
  list.flights = 1;
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_LE(pairs.size(), 4u * perLine * 12);
  const int turn = 12;  // photos, where the lines beside one follow it in the sequence
  for (int i = perLine; i < 3 * perLine; ++i) {
    if (i % perLine < turn || i % perLine >= perLine - turn) continue;
    int before = 0, same = 0, after = 0;
    for (const auto& [a, b] : pairs) {
      if (a != i && b != i) continue;
      const int line = (a == i ? b : a) / perLine - i / perLine;
      ++(line < 0 ? before : line > 0 ? after : same);
    }
    EXPECT_GE(before, 2) << i;
    EXPECT_GE(after, 2) << i;
    EXPECT_GE(same, 4) << i;
  }
}

// As along a road: there is nothing beside the line.
TEST(PhotoPairs, AreNoFewerOfASingleLine) {
  PhotoList list;
  list.bodies = survey(1, 1, 1).bodies;
  for (int i = 0; i < 80; ++i) list.photos.push_back(photoAt(6 * i, 0, 60, {90, -90, 0}, 0, 2 * i));
  list.flights = 1;
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  for (int apart = 1; apart <= 6; ++apart)
    EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(40, 40 + apart))) << apart;
}

// A place that is flown over every week.
TEST(PhotoPairs, StayFewOfManyFlights) {
  PhotoList list;
  for (int week = 0; week < 30; ++week) {
    PhotoList one = survey(4, 4, 15);
    list.bodies = one.bodies;
    for (ListedPhoto& photo : one.photos) {
      photo.flight = week;
      list.photos.push_back(photo);
    }
  }
  list.flights = 30;
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_EQ(groups(list, pairs), 1);
  EXPECT_LE(pairs.size(), list.photos.size() * (12 + 12 + 4)) << "of 30 each, without a limit on flights";
}

// Where no pair overlaps enough to be compared for that alone, those that overlap most connect each place.
TEST(PhotoPairs, ConnectEachPlaceByTheLargestOverlaps) {
  PhotoList list;
  list.bodies = survey(1, 1, 1).bodies;
  const int perLine = 10, perPlace = 3 * perLine;
  for (int i = 0; i < 2 * perPlace; ++i) {
    const int place = i / perPlace, line = i % perPlace / perLine, column = i % perLine;
    // One photo of each place is nearer to the line before its own.
    const double north = 50 * line - (line == 2 && column == 7 ? 6.5 : 0);
    list.photos.push_back(photoAt(5000 * place + 65 * column, north, 60, {0, -90, 0}, i, 0));
  }
  list.flights = 2 * perPlace;
  const std::vector<PhotoPair> pairs = choosePairs(list, {}, {.minOverlap = 0.9});
  EXPECT_EQ(groups(list, pairs), 2);
  EXPECT_EQ(pairs.size(), 2u * (perPlace - 1)) << "a spanning tree of each place";
  for (const auto& [a, b] : pairs) EXPECT_TRUE(b - a == 1 || b - a == perLine) << "not aslant: " << a << " " << b;
  EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(17, 27)));
  EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(47, 57)));
}

TEST(PhotoPairs, AreNotMadeOfPhotosThatLookAway) {
  PhotoList list = survey(7, 7, 15);
  // In the middle of the survey, but the ground that it shows is far to the north.
  list.photos.push_back(photoAt(45, 45, 60, {0, -15, 0}, 1, 1000));
  int partners = 0;
  for (const auto& [a, b] : choosePairs(list, {})) partners += b == 49 ? 1 : 0;
  EXPECT_LE(partners, 1) << "only what the spanning tree needs";
}

TEST(PhotoPairs, FollowTheSequenceWithoutGps) {
  PhotoList list = survey(7, 7, 15);
  for (ListedPhoto& photo : list.photos) photo.tags.gps.reset();
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_EQ(pairs.size(), 49u * 10 - 55);
  for (const auto& [a, b] : pairs) EXPECT_LE(b - a, 10);
}

TEST(PhotoPairs, OfPhotosWithoutGpsAreThoseThatLookAlike) {
  PhotoList list = survey(6, 10, 15);
  EXPECT_TRUE(photosForLookAlikes(list).empty());
  for (ListedPhoto& photo : list.photos) photo.tags.gps.reset();
  EXPECT_EQ(photosForLookAlikes(list).size(), 60u);
  EXPECT_TRUE(photosForLookAlikes(list, {.all = 60}).empty()) << "all pairs are compared anyway";
  LookAlikes lookAlikes(60);
  lookAlikes[0] = {0, 30, 40, 50};
  const PairOptions options{.sequence = 1, .lookAlikes = 2};
  const std::vector<PhotoPair> pairs = choosePairs(list, lookAlikes, options);
  EXPECT_EQ(pairs.size(), 59u + 2);
  EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(0, 40)));
  EXPECT_FALSE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(0, 50)));
  const std::vector<PhotoPair> more = chooseMorePairs(list, lookAlikes, {50});
  EXPECT_TRUE(std::binary_search(more.begin(), more.end(), PhotoPair(0, 50)));
  EXPECT_FALSE(std::binary_search(more.begin(), more.end(), PhotoPair(0, 40))) << "neither of them lacks a pose";
}

// Photos with GPS alone: their distances tell how high they are, and so which lines overlap.
TEST(PhotoPairs, FollowFromDistancesIfHeightsAreUnknown) {
  for (const double step : {2.0, 15.0, 60.0}) {
    PhotoList list = survey(8, 8, step);
    for (ListedPhoto& photo : list.photos) {
      photo.tags.gps->relativeAltitude = 0;
      photo.tags.gimbal.reset();
    }
    const std::vector<PhotoPair> pairs = choosePairs(list, {});
    EXPECT_EQ(groups(list, pairs), 1) << step;
    // Photo 19 is the fourth of the third line; 28 stands beside it, in the fourth line.
    EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(19, 28))) << step;
  }
}

// A drone that took off from a hill says that it is 8 m high where it is 60 m above the ground.
TEST(PhotoPairs, ConnectLinesOfADroneThatTookOffAboveTheGround) {
  PhotoList list = survey(12, 12, 15);
  for (ListedPhoto& photo : list.photos) photo.tags.gps->relativeAltitude = 8;
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  EXPECT_EQ(groups(list, pairs), 1);
  EXPECT_TRUE(std::binary_search(pairs.begin(), pairs.end(), PhotoPair(6, 17)));
}

// Photos of an album that are all tagged with one place.
TEST(PhotoPairs, OfPhotosWithOnePlaceAreThoseOfPhotosWithoutGps) {
  PhotoList album = survey(6, 10, 15);
  for (ListedPhoto& photo : album.photos) {
    photo.tags.gps = GpsFix{46.5, 6.5, 400, 0};
    photo.tags.gimbal.reset();
  }
  PhotoList bare = album;
  for (ListedPhoto& photo : bare.photos) photo.tags.gps.reset();
  EXPECT_EQ(photosForLookAlikes(album).size(), 60u);
  LookAlikes lookAlikes(60);
  lookAlikes[0] = {30, 40};
  EXPECT_EQ(choosePairs(album, lookAlikes), choosePairs(bare, lookAlikes));
}

// As of the underside of a bridge, of which the ground tells nothing.
TEST(PhotoPairs, OfPhotosAboveTheHorizonAreThoseOfPhotosWithoutGps) {
  PhotoList list = survey(6, 10, 15);
  for (size_t i = 20; i < 60; ++i) list.photos[i].tags.gimbal->pitch = 60;
  const std::vector<int> photos = photosForLookAlikes(list);
  ASSERT_EQ(photos.size(), 40u);
  EXPECT_EQ(photos.front(), 20);
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  const auto has = [&](int a, int b) { return std::binary_search(pairs.begin(), pairs.end(), PhotoPair(a, b)); };
  EXPECT_TRUE(has(40, 50));
  EXPECT_FALSE(has(40, 51));
}

// Drone photos with GPS among more photos without.
TEST(PhotoPairs, FollowFromGpsForThosePhotosThatHaveIt) {
  PhotoList list = survey(8, 12, 15);
  const int drone = static_cast<int>(list.photos.size());
  for (int i = 0; i < 150; ++i) {
    ListedPhoto photo;
    photo.flight = 1;
    list.photos.push_back(photo);
  }
  list.flights = 2;
  const std::vector<PhotoPair> pairs = choosePairs(list, {});
  const auto has = [&](int a, int b) { return std::binary_search(pairs.begin(), pairs.end(), PhotoPair(a, b)); };
  // Photo 25 is the second of the third line; 46 stands beside it, at the other end of the fourth.
  EXPECT_TRUE(has(25, 46));
  EXPECT_FALSE(has(25, 35)) << "ten apart in the sequence of photos with GPS";
  EXPECT_TRUE(has(drone, drone + 10)) << "ten apart in that of photos without";
  EXPECT_FALSE(has(drone, drone + 11));
}

TEST(LookAlikes, AreThoseThatTheProgramPrints) {
  const PhotoList list = survey(1, 4, 15);
  PhotoList named = list;
  for (size_t i = 0; i < 4; ++i) named.photos[i].safeName = "p" + std::to_string(i) + ".jpg";
  const LookAlikes lookAlikes = parseLookAlikes(
      "Indexing image [1/2] in 0.1s\n  image_id=1, image_name=p3.jpg, score=0.1\n"
      "Querying for image p0.jpg [1/2] in 0.141s\n  image_id=1, image_name=p0.jpg, score=0.45\n"
      "  image_id=3, image_name=p2.jpg, score=0.10\n  image_id=9, image_name=p9.jpg, score=0.10\n"
      "  image_id=2, image_name=p1.jpg, score=0.09\nQuerying for image p7.jpg [2/2] in 0.1s\n"
      "  image_id=1, image_name=p0.jpg, score=0.45\nQuerying for image p3.jpg [2/2] in 0.1s\n  image_name=p1.jpg, sc",
      named);
  EXPECT_EQ(lookAlikes, (LookAlikes{{2, 1}, {}, {}, {1}}));
}

}  // namespace
}  // namespace tessera
