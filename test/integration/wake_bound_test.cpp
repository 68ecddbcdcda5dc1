// SPDX-License-Identifier: BSL-1.0
// The limit on the wake-up latency of cores, which the kernel keeps for the whole host.

#include <cles/wake_bound.hpp>

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

BOOST_AUTO_TEST_SUITE(wake_bound)

using namespace std::chrono_literals;

constexpr const char* device_path = "/dev/cpu_dma_latency";

// In microseconds: the minimum that any program requests.
std::optional<std::int32_t> allowed_to_take() {
    std::ifstream device{device_path, std::ios::binary};
    std::array<char, sizeof(std::int32_t)> bytes{};
    if (!device.read(bytes.data(), bytes.size())) {
        return std::nullopt;
    }
    return std::bit_cast<std::int32_t>(bytes);
}

bool holds_open(const std::filesystem::path& file) {
    const std::filesystem::directory_iterator all{"/proc/self/fd"};
    return std::any_of(begin(all), end(all), [&](const auto& each) {
        std::error_code gone; // for the descriptor of the folder itself
        return std::filesystem::read_symlink(each, gone) == file;
    });
}

// If the host does not permit it, only the report of that can be tested.
bool is_kept_by_the_host(std::chrono::microseconds asked, std::int32_t expected) {
    try {
        const cles::wake_bound bound{asked};
        const auto during = allowed_to_take();
        return holds_open(device_path) && during && *during <= expected; // another program may request less
    } catch (const std::system_error& refused) {
        return std::string{refused.what()}.find(device_path) != std::string::npos;
    }
}

BOOST_AUTO_TEST_CASE(holds_until_it_is_destroyed) {
    BOOST_TEST(is_kept_by_the_host(7us, 7));
    BOOST_TEST(!holds_open(device_path));
}

BOOST_AUTO_TEST_CASE(is_never_negative_or_more_than_the_device_accepts) {
    BOOST_TEST(is_kept_by_the_host(-5us, 0));
    BOOST_TEST(is_kept_by_the_host(100h, std::numeric_limits<std::int32_t>::max()));
    BOOST_TEST(!holds_open(device_path));
}

BOOST_AUTO_TEST_SUITE_END()
