// Builds triangles from the plan of a city.
#pragma once

#include "synth/layout.h"
#include "synth/surface_mesh.h"

namespace tessera {

// Builds everything that does not move.
SurfaceMesh buildCity(const CityLayout& city);

void addGround(const CityLayout& city, SurfaceMesh& mesh);      // terrain, blocks, kerbs, water
void addBuilding(const Building& building, SurfaceMesh& mesh);  // walls, balconies, awnings, roof
void addRoof(const Building& building, SurfaceMesh& mesh);
void addTree(const Tree& tree, float ground, SurfaceMesh& mesh);
void addStreetFurniture(const CityLayout& city, SurfaceMesh& mesh);  // lamps, poles and their wires

// Adds a car standing at `foot` and facing `yaw`; its colour and size follow from the seed.
void addCar(const Vec3f& foot, float yaw, uint32_t seed, SurfaceMesh& mesh);

// Builds the moving cars at one moment. Lanes and speeds are a function of the city; `seconds` moves the cars.
SurfaceMesh buildTraffic(const CityLayout& city, double seconds);

}  // namespace tessera
