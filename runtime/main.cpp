// SPDX-License-Identifier: BSL-1.0
#include "daemon/clesd.hpp"

int main(int argc, char** argv) { return cles::runtime::clesd(argc, argv); }
