/* The version of oneray, as --version prints it and files carry it. */
#ifndef ONERAY_VERSION
#define ONERAY_VERSION "0.1.0"
#endif
