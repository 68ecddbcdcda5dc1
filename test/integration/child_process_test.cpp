// SPDX-License-Identifier: BSL-1.0
// A handler starts a program, as robots do to play a sound: it inherits no socket of the services.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/descriptors.hpp"
#include "support/group_address.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/temporary_folder.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(child_process)

using namespace cles::test;

namespace {

// The descriptors of a program that this one starts, without those that only list them.
std::vector<std::string> descriptors_of_a_child() {
    const temporary_folder folder{"cles-child"};
    const auto list = (folder / "list").string();
    const auto command = "for each in /proc/self/fd/*; do readlink $each; done 2>/dev/null | sort > " + list;
    BOOST_REQUIRE(std::system(command.c_str()) == 0); // NOLINT(concurrency-mt-unsafe)
    std::vector<std::string> found;
    std::ifstream in{list};
    for (std::string line; std::getline(in, line);) {
        if (line.starts_with("socket:") || line.starts_with("anon_inode:")) {
            found.push_back(line);
        }
    }
    return found;
}

struct nodes {
    std::vector<std::string> of_a_child = descriptors_of_a_child();
    std::set<std::string> inherited = inherited_descriptors();
    boost::asio::io_context io;
    cles::service car{io, [] {
                          auto options = listening("car1");
                          for (const auto kind : {carrier::unix_file, carrier::unix_abstract, carrier::udp4}) {
                              options.listen.push_back(fresh_address(kind));
                          }
                          options.multicast = fresh_group();
                          return options;
                      }()};
    cles::service user{io, {.name = "user"}};
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_program_that_a_handler_starts_inherits_no_socket, nodes) {
    std::vector<std::string> found;
    car.on_push("play", [&] { found = descriptors_of_a_child(); });
    car.on_bind("position");
    for (const auto& url : car.endpoints()) {
        answer<> asked;
        user.async_request("PUSH car1:play", asked.options().at(url), asked.take());
        run_until(io, [&] { return asked.done(); });
        BOOST_TEST(!asked.code, url);
        BOOST_TEST(found == of_a_child, url);
        BOOST_TEST(inherited_descriptors() == inherited, boost::test_tools::per_element());
    }
}

BOOST_FIXTURE_TEST_CASE(a_child_does_not_hold_the_port_of_a_service_that_has_ended, nodes) {
    pid_t child = -1;
    car.on_push("play", [&] {
        child = ::fork();
        if (child == 0) {
            ::execl("/bin/sleep", "sleep", "60", nullptr);
            ::_exit(1);
        }
    });
    const auto url = car.endpoints().front();
    answer<> asked;
    user.async_request("PUSH car1:play", asked.options().at(url), asked.take());
    run_until(io, [&] { return asked.done(); });
    BOOST_REQUIRE(child > 0);
    // The child runs its program as soon as it has no memory in common with this process.
    const auto program = "/proc/" + std::to_string(child) + "/comm";
    run_until(io, [&] {
        std::string name;
        std::getline(std::ifstream{program}, name);
        return name == "sleep";
    });
    car.stop();
    run_ready(io);
    BOOST_CHECK_NO_THROW(cles::service(io, {.name = "car1", .listen = {url}}));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
}

BOOST_AUTO_TEST_SUITE_END()
