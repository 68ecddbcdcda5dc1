// SPDX-License-Identifier: BSL-1.0
#include "support/descriptors.hpp"
#include "support/temporary_folder.hpp"
#include "system/whole_file.hpp"

#include <boost/test/unit_test.hpp>

#include <fstream>
#include <set>
#include <string>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(whole_file)

BOOST_AUTO_TEST_CASE(it_is_read_whole_or_in_part) {
    const cles::test::temporary_folder folder{"cles-whole-file"};
    const auto path = (folder.path() / "file").string();
    const std::string content(200'000, 'x');
    std::ofstream{path} << content;
    std::string text = "what was there";
    BOOST_TEST(!tool::read_file(path, text));
    BOOST_TEST(text == content);
    BOOST_TEST(!tool::read_file(path, text, 70'000));
    BOOST_TEST(text.size() == 70'000U);
    BOOST_TEST(!tool::read_file("/proc/self/statm", text)); // states no size
    BOOST_TEST(!text.empty());
}

BOOST_AUTO_TEST_CASE(what_cannot_be_read_is_told) {
    std::string text = "what was there";
    BOOST_TEST((tool::read_file("/nowhere/file", text) == std::errc::no_such_file_or_directory));
    BOOST_TEST(text.empty());
    BOOST_TEST((tool::read_file("/proc", text) == std::errc::is_a_directory));
}

BOOST_AUTO_TEST_CASE(no_program_that_is_started_meanwhile_inherits_it) {
    const cles::test::temporary_folder folder{"cles-whole-file"};
    const auto path = (folder.path() / "pipe").string();
    BOOST_REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
    const auto before = cles::test::inherited_descriptors();
    std::string text;
    std::thread reader{[&] { static_cast<void>(tool::read_file(path, text)); }};
    const int other_end = ::open(path.c_str(), O_WRONLY | O_CLOEXEC); // returns once it is open there
    const auto meanwhile = cles::test::inherited_descriptors();
    BOOST_TEST(::write(other_end, "text", 4) == 4);
    ::close(other_end);
    reader.join();
    BOOST_TEST((meanwhile == before));
    BOOST_TEST(text == "text");
}

BOOST_AUTO_TEST_SUITE_END()
