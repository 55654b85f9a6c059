"""The jail: where student code runs, hostile by assumption.

In come a command, the folders that it may read and write, and limits. Out come how it ended, how long it took
and the end of what it said, when every process of it is dead; and its picture, decoded apart from this
process.

sandbox  which jails there are, the strongest that works here, and a command in one
limits   what a program may take
confine  the jail that needs no name spaces: a server of its own, started from its file, with the standard
         library alone; confined is a command in it
cgroups  limits of all processes together, by the kernel
watch    time, memory and files of a running program; ends it beyond its bounds
folders  folders that it may have filled
apart    a process without privileges, for what reads the bytes of strangers
pixels   a picture out of the jail
"""
