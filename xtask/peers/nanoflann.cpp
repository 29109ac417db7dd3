// Gathers by nanoflann: photons (position and flux), then sets of places to gather at. It finds photons by place alone.
//
// "nearest SET N K RADIUS" and "within SET N RADIUS" gather at each place of a set, N times, with the weights that ours
// have; "build N" builds the tree. The checksum is the sum of flux.

#include <cstring>
#include <memory>
#include <nanoflann.hpp>

#include "peer.hpp"

struct Photons {
    const Array& values;
    std::size_t kdtree_get_point_count() const { return values.size() / 6; }
    float kdtree_get_pt(std::size_t i, std::size_t axis) const { return values[6 * i + axis]; }
    template <class Box> bool kdtree_get_bbox(Box&) const { return false; }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Photons>, Photons, 3, std::uint32_t>;

// Photons within a radius, added as they are found.
struct Sum {
    using DistanceType = float;
    const Photons& photons;
    float radius2;
    float sum[3] = {};
    std::size_t count = 0;

    std::size_t size() const { return count; }
    bool full() const { return true; }
    float worstDist() const { return radius2; }
    bool addPoint(float distance2, std::uint32_t i) {
        if (distance2 < radius2) {
            const float* flux = &photons.values[6 * i + 3];
            const float weight = 1 - distance2 / radius2;
            for (int c = 0; c < 3; ++c) sum[c] += weight * flux[c];
            ++count;
        }
        return true;
    }
};

int main(int, char** argv) {
    const std::vector<Array> arrays = read_arrays(argv[1]);
    const Photons photons{arrays[0]};
    const auto build = [&] {
        return std::make_unique<Tree>(3, photons, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    };
    std::unique_ptr<Tree> tree;
    char what[16];
    while (std::scanf("%15s", what) == 1) {
        unsigned set = 0;
        unsigned long long n = 0, k = 0;
        float radius = 0;
        if (std::strcmp(what, "build") == 0) {
            if (std::scanf("%llu", &n) != 1) return 1;
            answer(n, [&] { tree = build(); return double(photons.kdtree_get_point_count()); });
            continue;
        }
        if (!tree) tree = build();
        const bool nearest = std::strcmp(what, "nearest") == 0;
        if (std::scanf("%u %llu", &set, &n) != 2) return 1;
        if (nearest && std::scanf("%llu", &k) != 1) return 1;
        if (std::scanf("%f", &radius) != 1) return 1;
        const Array& places = arrays[1 + set];
        std::vector<std::uint32_t> indices(k);
        std::vector<float> distances(k);
        answer(n, [&] {
            double total = 0;
            for (std::size_t i = 0; i + 3 <= places.size(); i += 3) {
                if (!nearest) {
                    Sum sum{photons, radius * radius};
                    tree->findNeighbors(sum, &places[i], nanoflann::SearchParams());
                    total += sum.sum[0] + sum.sum[1] + sum.sum[2];
                    continue;
                }
                nanoflann::KNNResultSet<float, std::uint32_t> found(k);
                found.init(indices.data(), distances.data());
                tree->findNeighbors(found, &places[i], nanoflann::SearchParams());
                std::size_t count = 0;
                while (count < found.size() && distances[count] < radius * radius) ++count;
                const float radius2 = count ? distances[count - 1] : 1;
                for (std::size_t j = 0; j < count; ++j) {
                    const float* flux = &photons.values[6 * indices[j] + 3];
                    total += (1 - distances[j] / radius2) * (flux[0] + flux[1] + flux[2]);
                }
            }
            return total;
        });
    }
}
