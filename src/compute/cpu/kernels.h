// The kernels behind the cpu device, one file per interface header. Each cuts its work into tasks whose inputs and
// outputs depend on the task's number alone; sums over tasks are taken in task order. That makes the bits independent
// of the number of threads. They are the functions run(Context&, const Operation&), which device.cpp declares.
#pragma once

#include <cstddef>

#include "base/threads.h"

namespace tessera::cpu {

struct Context {
  ThreadPool& pool;
};

const char* simdTarget();  // the instruction set chosen at run time: "SSE4", "AVX2", "AVX3"

// Multiply-adds per second (counted as 2 operations each) that all threads reach together on registers alone.
double peakFlops(ThreadPool& pool);
// 8-byte loads per second at random places of a table of `bytes`, indices streamed from memory, all threads together.
double gatherRate(ThreadPool& pool, size_t bytes, int tables);
// Bytes per second, read + written, of copies from one half of `bytes` to the other, all threads together.
double streamRate(ThreadPool& pool, size_t bytes);

}  // namespace tessera::cpu
