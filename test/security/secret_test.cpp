// SPDX-License-Identifier: BSL-1.0
#include "security/keys/secret.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>

namespace secret {
namespace {

using cles::security::secret_bytes;

// The sanitizers do not let a process lock memory.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

bool is_zero(const secret_bytes& bytes) {
    return std::ranges::all_of(bytes.view(), [](auto byte) { return byte == 0; });
}

// What /proc/self/smaps reports for the mapping that contains the address.
struct mapping {
    std::uint64_t locked_kib = 0;
    bool dumped = true;
};

mapping mapping_of(const void* address) {
    const auto wanted = reinterpret_cast<std::uintptr_t>(address);
    std::ifstream smaps{"/proc/self/smaps"};
    BOOST_REQUIRE(smaps);
    mapping found;
    bool inside = false;
    for (std::string line; std::getline(smaps, line);) {
        std::istringstream words{line};
        std::uintptr_t begin = 0;
        std::uintptr_t end = 0;
        char dash = 0;
        if (line.find(' ') != std::string::npos && line.find('-') < line.find(' ') &&
            words >> std::hex >> begin >> dash >> end) {
            inside = wanted >= begin && wanted < end;
        } else if (inside && line.starts_with("Locked:")) {
            found.locked_kib = std::stoull(line.substr(7));
        } else if (inside && line.starts_with("VmFlags:")) {
            found.dumped = line.find(" dd") == std::string::npos;
        }
    }
    return found;
}

} // namespace

BOOST_AUTO_TEST_SUITE(secret)

BOOST_AUTO_TEST_CASE(memory_is_locked_and_left_out_of_core_dumps) {
    for (const std::size_t size : {32U, 64U, 65U, 20000U}) {
        const auto bytes = secret_bytes::random(size);
        const auto found = mapping_of(bytes.data());
        BOOST_TEST(!found.dumped);
        rlimit limit{};
        BOOST_REQUIRE(getrlimit(RLIMIT_MEMLOCK, &limit) == 0);
        if (!sanitized && limit.rlim_cur >= std::uint64_t{64} * 1024) {
            BOOST_TEST(found.locked_kib * 1024 >= size);
        }
    }
}

BOOST_AUTO_TEST_CASE(thousands_of_keys_lock_little_memory) {
    std::vector<secret_bytes> keys;
    for (int i = 0; i < 1000; ++i) {
        keys.push_back(secret_bytes::random(32));
    }
    std::vector<std::uintptr_t> pages;
    for (const auto& key : keys) {
        pages.push_back(reinterpret_cast<std::uintptr_t>(key.data()) / 4096);
    }
    std::ranges::sort(pages);
    const auto repeated = std::ranges::unique(pages);
    BOOST_TEST(static_cast<std::size_t>(repeated.begin() - pages.begin()) <= 17U);
}

BOOST_AUTO_TEST_CASE(secrets_do_not_overlap) {
    std::vector<secret_bytes> kept;
    for (std::size_t i = 0; i < 300; ++i) {
        secret_bytes made{1 + i % 70};
        std::ranges::fill(made.span(), static_cast<std::uint8_t>(i));
        kept.push_back(std::move(made));
        if (i % 3 == 2) {
            kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(i / 3)); // makes holes
        }
    }
    for (const auto& bytes : kept) {
        BOOST_TEST(std::ranges::all_of(bytes.view(), [&](auto byte) { return byte == bytes.view()[0]; }));
    }
}

BOOST_AUTO_TEST_CASE(memory_is_wiped) {
    const auto page_of = [](const secret_bytes& bytes) {
        return reinterpret_cast<std::uintptr_t>(bytes.data()) / 4096;
    };
    std::vector<secret_bytes> made;
    do {
        made.push_back(secret_bytes::random(32));
    } while (made.size() < 2 || page_of(made.back()) != page_of(made[made.size() - 2]));
    // The one before keeps the page mapped.
    const std::uint8_t* const freed = made.back().data();
    BOOST_TEST(!is_zero(made.back()));
    made.pop_back();
    BOOST_TEST(std::all_of(freed, freed + 32, [](auto byte) { return byte == 0; }));
}

BOOST_AUTO_TEST_CASE(a_new_secret_is_zero) {
    for (const std::size_t size : {1U, 64U, 65U, 5000U}) {
        { const auto before = secret_bytes::random(size); }
        BOOST_TEST(is_zero(secret_bytes{size}));
    }
}

BOOST_AUTO_TEST_CASE(a_moved_from_secret_is_empty) {
    auto from = secret_bytes::random(32);
    const auto* const address = from.data();
    const secret_bytes to{std::move(from)};
    BOOST_TEST(to.data() == address);
    BOOST_TEST(to.size() == 32U);
    BOOST_TEST(from.size() == 0U); // NOLINT(bugprone-use-after-move)
    BOOST_TEST(from.view().empty());
}

BOOST_AUTO_TEST_CASE(a_copy_is_equal_and_separate) {
    auto from = secret_bytes::random(32);
    const auto made = from.copy();
    BOOST_TEST(std::ranges::equal(made.view(), from.view()));
    from.data()[0] ^= 1U;
    BOOST_TEST(!std::ranges::equal(made.view(), from.view()));
    BOOST_TEST(secret_bytes{}.copy().size() == 0U);
}

BOOST_AUTO_TEST_CASE(random_secrets_differ) {
    BOOST_TEST(secret_bytes::random(0).size() == 0U);
    BOOST_TEST(!std::ranges::equal(secret_bytes::random(32).view(), secret_bytes::random(32).view()));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace secret
