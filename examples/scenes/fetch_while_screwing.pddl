; A person screws parts together that stand on their bench, and robots bring more. Grasping and placing are those of the
; domain `screwdriver`; parts that are made for each other are screwed where they stand, by a person with a free hand.
(define (domain fetch_while_screwing)
  (:requirements :strips :typing :negative-preconditions)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table)
    (fit ?o1 - thing ?o2 - thing)
    (screwed ?o1 - thing ?o2 - thing))

  (:action grasp
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  (:action place
    :parameters (?e - hand ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o)))

  (:action screw
    :parameters (?e - human_hand ?o1 - thing ?o2 - thing)
    :precondition (and (free ?e) (on_table ?o1) (on_table ?o2) (fit ?o1 ?o2) (not (screwed ?o1 ?o2)))
    :effect (screwed ?o1 ?o2)))
