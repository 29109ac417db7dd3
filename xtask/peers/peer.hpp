// What the programs beside our benchmarks share: arrays of floats from a file, and questions on standard input.
//
// The file is a sequence of arrays, each a count of 64 bits and so many floats. A question is a line; its answer is a
// checksum and the nanoseconds that it took.

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

using Array = std::vector<float>;

inline std::vector<Array> read_arrays(const char* path) {
    std::FILE* file = std::fopen(path, "rb");
    if (!file) { std::perror(path); std::exit(1); }
    std::vector<Array> arrays;
    std::uint64_t count;
    while (std::fread(&count, sizeof count, 1, file) == 1) {
        Array values(count);
        if (std::fread(values.data(), sizeof(float), count, file) != count) {
            std::fprintf(stderr, "%s ends too early\n", path);
            std::exit(1);
        }
        arrays.push_back(std::move(values));
    }
    std::fclose(file);
    return arrays;
}

// Answers a question: `once` is asked `n` times, and its last checksum told.
template <class F>
void answer(std::uint64_t n, F once) {
    double sum = 0;
    const auto start = std::chrono::steady_clock::now();
    for (std::uint64_t i = 0; i < n; ++i) sum = once();
    const auto took = std::chrono::steady_clock::now() - start;
    std::printf("%.9g %lld\n", sum,
        static_cast<long long>(std::chrono::duration_cast<std::chrono::nanoseconds>(took).count()));
    std::fflush(stdout);
}
