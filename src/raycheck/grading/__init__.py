"""Grading of course assignments: submissions that nobody trusts, judged by pixels alone.

In come an assignment, a TOML file with its tasks, limits and scenes, and what students handed in: a folder or
an archive with a program, or pictures. Out come points, verdicts and reasons for each task, as a page for the
student, tables for the course, and files for the platforms that collect submissions.

assignment      what is asked, checked key by key; assignment_bundle takes all of it elsewhere
keys, hidden    the secret, and the variants of scenes that no student has seen
submission      what is handed in, unpacked without trust
jail            runs it, and takes its pictures over the border
program         a submission's program as a renderer
judge           verdicts and points; points, noise, speed, handed_in, shown are its parts
one_submission  grades one in a process of its own; course grades a class
results         what came out; written has it as pages, tables and files
handout         the students' starting point, c_functions the bodies that it leaves out
attacks         the grader's own test: hostile submissions
package         an autograder to be uploaded; autograder is what runs there
"""
