; Robots of one cell take, put down and pass things to each other. All geometry is that of shipped actions.
(define (domain over_the_wall)
  (:requirements :strips :typing :equality :action-costs)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table))
  (:functions (total-cost) - number)

  (:action grasp
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  (:action place
    :parameters (?e - hand ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o)))

  ; two controllers have to wait for each other: dearer than its motion alone
  (:action handover
    :parameters (?e1 - hand ?o - thing ?e2 - hand)
    :precondition (and (grasped ?e1 ?o) (free ?e2) (not (= ?e1 ?e2)))
    :effect (and (grasped ?e2 ?o) (not (free ?e2)) (not (grasped ?e1 ?o)) (free ?e1) (increase (total-cost) 0.5))))
