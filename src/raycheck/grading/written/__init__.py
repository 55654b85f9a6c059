"""What a grading leaves: results in the forms that people and platforms read.

In come the results of students and the assignment. Out come a page for each student and one for the course, a
table of grades with the teacher's overrides, JUnit XML, and the JSON that Gradescope takes.

pages       HTML
tables      grades.csv, rosters and overrides, JUnit
gradescope  results.json
"""
